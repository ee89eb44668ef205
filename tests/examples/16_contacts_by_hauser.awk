# limber's own keeps a box on the slope; the heuristic lets it creep, springs let it sink; programs are solved by two rules.
/ creeps / {
  rules++
  match($0, /creeps [-+0-9.e]+/); creep = substr($0, RSTART + 7, RLENGTH - 7) + 0
  match($0, /second, [-+0-9.e]+/); height = substr($0, RSTART + 8, RLENGTH - 8) + 0
  programs = $(NF - 1)
}
/^limber's own/ { between(creep, 0, 1e-5, "creep of limber's own, m"); between(height, -1e-3, 1e-3, "height, m") }
/^penalty/ { between(height, -0.02, -1e-5, "height on springs, m") }
/heuristic/ { between(creep, 1e-5, 0.1, "creep by the heuristic, m") }
/program +creeps/ { between(programs, 1, 1e6, "linear programs") }
END { expect(rules == 5, "five rules") }
