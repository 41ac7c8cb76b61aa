"""`python -m merge_cosim`: the command line, where the program `merge-cosim` is not on the path."""

from merge_cosim.cli.main import main

if __name__ == "__main__":
    main()
