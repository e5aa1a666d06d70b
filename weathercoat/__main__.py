"""`python -m weathercoat`."""

from weathercoat.cli import main

if __name__ == "__main__":
    main()
