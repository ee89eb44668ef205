# The held point is at its target to round-off; a spring pulls no harder than 20 N along each axis; let go, it falls.
/ s: force / { n++; between($(NF - 1), 0, 1e-9, "error, m"); between($4, 0.1, 100, "force, N") }
/worst error/ { dragged = 1; between($(NF - 1), 0, 1e-9, "worst error, m") }
/^mouse spring/ { pulled = 1; between($4, 0.1, 20 * sqrt(3), "force, N"); between($6, 0, 1, "distance, m") }
/^let go/ { fell = 1; between($4, 0.3, 3, "fall in half a second, 1.2 m without what it had, m") }
END { expect(n == 4 && dragged && pulled && fell, "four moments, the drag, the spring and the fall") }
