/^fall.pov: / { n++; between($2, 3, 3, "instants"); between($5, 5, 5, "bodies") }
END { expect(n == 1, "one picture") }
