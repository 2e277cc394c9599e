"""`python -m pinbound` is the command line program."""

from pinbound.cli import main

if __name__ == "__main__":
    main()
