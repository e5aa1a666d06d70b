"""The report of a comparison: one HTML page that needs nothing but itself, and its record as JSON."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from pathlib import Path

from weathercoat import __version__
from weathercoat.comparison.charts import Line, draw_chart
from weathercoat.comparison.compare import Comparison, Group, Pair, Side
from weathercoat.comparison.geometry import describe
from weathercoat.comparison.images import PictureDifference
from weathercoat.comparison.judgement import Difference
from weathercoat.comparison.record import make_record, ranked, share_of_allowed
from weathercoat.comparison.sides import Run
from weathercoat.comparison.statistics import RunFigures
from weathercoat.output.report import write_json

PAGE, RECORD = "compare.html", "compare.json"
_STYLE = Path(__file__).with_name("page.css")
_MOST_PAIRS = 12  # with pictures on the page: those that look most different
_MOST_NAMES = 12
_MINUS = "\N{MINUS SIGN}"
# The first pictures to slide over are those of the last age; those of another come with a click.
_SCRIPT = """
for (const stage of document.querySelectorAll(".stage")) {
  const rows = stage.parentNode.querySelectorAll(".age");
  const show = row => stage.querySelectorAll("img").forEach((image, i) => {
    image.src = row.querySelectorAll("img")[i].src;
  });
  stage.querySelector("input").oninput = event => stage.style.setProperty("--at", event.target.value + "%");
  rows.forEach(row => row.onclick = () => {
    show(row);
    stage.scrollIntoView({behavior: "smooth", block: "center"});
  });
  if (rows.length) { show(rows[rows.length - 1]); stage.hidden = false; }
}
"""


def write_report(folder: Path, comparison: Comparison) -> None:
    """Write `compare.html` and `compare.json` into a folder. Raises OSError where they cannot be written."""
    write_json(folder / RECORD, make_record(comparison))
    (folder / PAGE).write_bytes(make_page(comparison).encode("utf-8", "backslashreplace"))


def make_page(comparison: Comparison) -> str:
    """The page, with pictures, styles and the little that moves inside it."""
    verdict = comparison.verdict
    title = f"{comparison.a.path.name} and {comparison.b.path.name}: {verdict}"
    parts = [
        '<!doctype html>\n<html lang="en">\n<meta charset="utf-8">\n',
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n',
        f"<title>{escape(title)}</title>\n<style>\n{_STYLE.read_text(encoding='utf-8')}</style>\n<body>\n",
        f'<header class="verdict {verdict.split()[0]}"><p class="of">Comparison of two results</p>'
        f"<h1>{verdict.capitalize()}</h1><p>{escape(_sentence(comparison.method))}</p></header>\n",
        f'<div class="sides">{_side("A", comparison.a)}{_side("B", comparison.b)}</div>\n',
        *(_findings(side) for side in (comparison.a, comparison.b) if side.findings),
    ]
    for group in comparison.groups:
        parts += _group(group, is_titled=len(comparison.groups) > 1)
    if comparison.configs:
        parts.append(_configs(comparison))
    parts.append(f"<footer>Written by weathercoat {__version__}. The same as data: {RECORD}.</footer>\n")
    parts.append(f"<script>{_SCRIPT}</script>\n</body>\n</html>\n")
    return "".join(parts)


def _sentence(method: str) -> str:
    return method[:1].upper() + method[1:]


def _side(letter: str, side: Side) -> str:
    runs = side.runs
    seeds = [str(run.seed) for run in runs if run.seed is not None]
    rows = [
        ("runs", f"{len(runs):,}: {_names(run.name for run in runs)}" if len(runs) > 1 else ""),
        ("model", _names(sorted({name for run in runs for name in run.models}))),
        ("seed" if len(seeds) == 1 else "seeds", _names(dict.fromkeys(seeds))),
        ("versions", _names(sorted({_versions(run) for run in runs}))),
    ]
    facts = "".join(f"<dt>{name}</dt><dd>{escape(text)}</dd>" for name, text in rows if text)
    return (
        f'<section class="card"><div class="name"><span class="tag {letter.lower()}">{letter}</span>'
        f'<span class="path">{escape(str(side.path))}</span></div><dl>{facts}</dl></section>'
    )


def _versions(run: Run) -> str:
    """Versions with this program's own first."""
    found = sorted(run.versions.items(), key=lambda item: (item[0] != "weathercoat", item[0]))
    return ", ".join(f"{name} {version}" for name, version in found)


def _names(names: Iterable[str]) -> str:
    found = list(names)
    more = f" and {len(found) - _MOST_NAMES:,} more" if len(found) > _MOST_NAMES else ""
    return ", ".join(found[:_MOST_NAMES]) + more


def _findings(side: Side) -> str:
    rows = "".join(
        f'<tr><td class="text"><code>{escape(prefix + finding.file)}</code></td>'
        f'<td class="text">{escape(finding.message)}</td></tr>'
        for prefix, findings in side.findings_by_prefix()
        for finding in findings
    )
    name = escape(str(side.path))
    return (
        f'<h2>What is wrong with <span class="path">{name}</span></h2><div class="scroll"><table>'
        f'<tr><th>File</th><th class="text">Finding</th></tr>{rows}</table></div>\n'
    )


def _group(group: Group, *, is_titled: bool) -> Iterator[str]:
    if is_titled:
        method = escape(_sentence(group.judgement.method))
        yield f"<h2>{escape(group.title)}: {group.judgement.verdict}</h2><p>{method}</p>\n"
    heading = "h3" if is_titled else "h2"
    found = ranked(group.judgement.differences)
    yield f"<{heading}>What differs</{heading}>\n{_table(found)}"
    shown = sorted((pair for pair in group.pairs if pair.pictures), key=_worst_flip, reverse=True)
    if shown:
        yield f"<{heading}>Pictures</{heading}>\n{_pictures(shown, len(group.pairs))}"
    yield f"<{heading}>Figures over age</{heading}>\n{_charts(group, found)}"
    yield f"<{heading}>Geometry</{heading}>\n{_geometry(group.pairs)}"


def _worst_flip(pair: Pair) -> float:
    return max(found.flip for found in pair.pictures)


def _table(found: Sequence[Difference]) -> str:
    """A row a figure, at the age at which it differs most."""
    head = "".join(
        f"<th>{name}</th>" for name in ("Figure", "Age", "A", "B", f"B {_MINUS} A", "Allowed", "Share of it")
    )
    rows = [_row(difference) for difference in found if difference.difference != 0.0]
    if not rows:
        return "<p>No figure differs at any age.</p>\n"
    same = len(found) - len(rows)
    note = f'<p class="soft">{same:,} more are equal at every age.</p>' if same else ""
    return f'<div class="scroll"><table><tr>{head}</tr>{"".join(rows)}</table></div>{note}\n'


def _row(difference: Difference) -> str:
    share = share_of_allowed(difference)
    width = 50.0 * min(share, 2.0)
    text = "none is" if math.isinf(share) else f"{100.0 * share:,.0f} %"
    kind = ' class="beyond"' if difference.is_beyond else ""
    return (
        f"<tr{kind}><td>{_label(difference.figure)}</td><td>{difference.age:.3g}</td>"
        f"<td>{difference.a:.4g}</td><td>{difference.b:.4g}</td>"
        f'<td class="gap">{_signed(difference.difference)}</td><td>± {difference.allowed:.3g}</td>'
        f'<td><span class="bar" title="{text}"><i style="width:{width:.1f}%"></i><b></b></span></td></tr>'
    )


def _signed(value: float) -> str:
    return f"{value:+.3g}".replace("-", _MINUS, 1)


def _label(figure: str) -> str:
    return escape(figure.replace("_", " "))


def _pictures(pairs: Sequence[Pair], pair_count: int) -> str:
    """A stage to slide between A and B, and the pictures of each age side by side."""
    parts = [
        '<div><div class="stage" hidden><img alt="A"><img alt="B"><span class="tag a">A</span>'
        '<span class="tag b">B</span><input type="range" min="0" max="100" value="50" step="0.1"'
        ' aria-label="Slide between A and B"></div>\n',
        '<div class="heads"><span><span class="tag a">A</span></span>'
        '<span><span class="tag b">B</span></span>'
        '<span>Perceived difference, FLIP: 0<span class="ramp"></span>1</span></div>\n',
    ]
    for pair in reversed(pairs[:_MOST_PAIRS]) if pair_count > 1 else pairs:
        name = f"{escape(pair.a.name)} and {escape(pair.b.name)}, " if pair_count > 1 else ""
        parts += [_age(found, name) for found in pair.pictures]
    if len(pairs) > _MOST_PAIRS:
        parts.append(f'<p class="soft">Shown are the {_MOST_PAIRS} pairs that look most different.</p>')
    return "".join([*parts, "</div>\n"])


def _age(found: PictureDifference, name: str) -> str:
    images = "".join(
        f'<img src="data:image/webp;base64,{base64.b64encode(content).decode()}" alt="{alt}" loading="lazy">'
        for alt, content in (("A", found.a), ("B", found.b), ("where they differ", found.difference))
    )
    return (
        f'<div class="age"><p>{name}age <strong>{found.age:.3g}</strong>,'
        f" mean difference <strong>{found.flip:.4f}</strong></p>{images}</div>\n"
    )


def _charts(group: Group, found: Sequence[Difference]) -> str:
    several = max(len(group.a), len(group.b)) > 1
    mean = ", mean of its runs" if several else ""
    thin = "<span>thin: single runs</span>" if several else ""
    legend = (
        f'<p class="legend"><span><i style="background:var(--a)"></i>A{mean}</span>'
        f'<span><i style="background:var(--b)"></i>B{mean}</span>{thin}'
        '<span><i class="band"></i>what B may be: A and the difference that is allowed</span></p>'
    )
    charts = "".join(_chart(group, difference) for difference in found)
    return f'{legend}<div class="charts">{charts}</div>\n'


def _chart(group: Group, worst: Difference) -> str:
    figure = worst.figure
    band = sorted(
        (d.age, d.a - d.allowed, d.a + d.allowed)
        for d in group.judgement.differences
        if d.figure == figure and math.isfinite(d.allowed)
    )
    drawn = draw_chart(_label(figure), _lines(group.a, figure), _lines(group.b, figure), band)
    flag = "<span>beyond</span>" if worst.is_beyond else ""
    kind = ' class="beyond"' if worst.is_beyond else ""
    return f"<figure{kind}><figcaption>{_label(figure)}{flag}</figcaption>{drawn}</figure>"


def _lines(runs: Sequence[RunFigures], figure: str) -> list[Line]:
    return [list(zip(run.ages, run.figures[figure], strict=True)) for run in runs if figure in run.figures]


def _geometry(pairs: Sequence[Pair]) -> str:
    """A row for each age of each pair."""
    rows = "".join(
        f'<tr><td class="text">{escape(pair.a.name)} and {escape(pair.b.name)}</td>'
        f'<td class="text">{escape(describe(found))}</td></tr>'
        for pair in pairs
        for found in pair.geometry
    )
    missing = "".join(
        f'<p class="soft">Not compared, {escape(pair.a.name)} and {escape(pair.b.name)}: {escape(what)}.</p>'
        for pair in pairs
        for what in pair.missing
    )
    table = (
        f'<div class="scroll"><table><tr><th>Runs</th><th class="text">Films</th></tr>{rows}</table></div>'
        if rows
        else ""
    )
    return f"{table}{missing}\n"


def _configs(comparison: Comparison) -> str:
    rows = "".join(
        f'<tr><td><code>{escape(key)}</code></td><td class="text"><code>{escape(a) or "-"}</code></td>'
        f'<td class="text"><code>{escape(b) or "-"}</code></td></tr>'
        for key, (a, b) in comparison.configs.items()
    )
    return (
        "<h2>Configs</h2><p>Keys whose values differ. They have no say in the verdict.</p>"
        '<div class="scroll"><table><tr><th>Key</th><th class="text">A</th><th class="text">B</th></tr>'
        f"{rows}</table></div>\n"
    )
