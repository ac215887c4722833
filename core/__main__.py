"""`python -m core` is `stripe-core`."""

from core.cli import run

if __name__ == "__main__":
    run()
