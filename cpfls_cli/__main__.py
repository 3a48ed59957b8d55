"""Run the command line as ``python -m cpfls_cli``."""

from cpfls_cli.cli.main import run

if __name__ == "__main__":
    run()
