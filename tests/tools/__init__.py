"""What tests share: bodies, made-up results, a plain solver for tissue, work for other processes."""
