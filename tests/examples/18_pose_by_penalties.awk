# The same drag: constraints hold joints to round-off; penalties leave them off by little.
/^constraints/ { seen++; between($NF, 0, 1e-9, "joints' error by constraints") }
/^penalties/ { seen++; between($NF, 1e-12, 1e-2, "joints' error by penalties") }
END { expect(seen == 2, "both forms") }
