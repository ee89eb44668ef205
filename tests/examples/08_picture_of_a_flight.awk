/^flight.pov: / { n++; between($2, 6, 6, "instants"); between($5, 1000, 1e6, "vertices"); between($(NF - 2), 1e-6, 1e3, "strike, N s") }
END { expect(n == 1, "one picture") }
