"""What a diagnosis must show, each claim on machines of the generator: ``python -m`` this."""
