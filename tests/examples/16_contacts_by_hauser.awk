# limber's own keeps a box on the slope and at its height; springs let it sink; friction after the normals lets it slide.
/ creeps / {
  rules++
  match($0, /creeps [-+0-9.e]+/); creep = substr($0, RSTART + 7, RLENGTH - 7) + 0
  match($0, /second, [-+0-9.e]+/); height = substr($0, RSTART + 8, RLENGTH - 8) + 0
  programs = $(NF - 1)
}
/^limber's own/ { between(creep, 0, 1e-6, "creep of limber's own, m"); between(height, -1e-5, 1e-5, "height, m") }
/^penalty/ { between(creep, 0, 1e-6, "creep on springs with the cone, m"); between(height, -1e-3, -1e-5, "height on springs, m") }
/heuristic|program +creeps/ { between(creep, 1e-3, 1, "creep where friction comes after the normals, m") }
/program +creeps/ { between(programs, 1, 1e6, "linear programs") }
END { expect(rules == 5, "five rules") }
