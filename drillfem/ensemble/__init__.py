"""Random fields and inputs, samples of them, and what runs and judges an ensemble."""
