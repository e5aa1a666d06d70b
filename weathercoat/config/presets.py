"""The shipped configs, by name."""

from __future__ import annotations

from pathlib import Path


def presets_folder() -> Path:
    """The folder of the shipped configs: inside an installed package, beside the package in a source tree."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "configs"
    return installed if installed.is_dir() else package.parent / "configs"


def preset_names() -> list[str]:
    """Names of the shipped configs, sorted."""
    return sorted(path.stem for path in presets_folder().glob("*.yaml"))


def preset_path(name: str) -> Path:
    """The file of a shipped config; `name` is one of `preset_names`."""
    return presets_folder() / f"{name}.yaml"


def preset_purpose(name: str) -> str:
    """The first sentence of the comment that heads a shipped config."""
    comment: list[str] = []
    for line in preset_path(name).read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        comment.append(line.lstrip("# "))
    return " ".join(comment).partition(". ")[0].rstrip(".")
