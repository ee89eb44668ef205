# The same drag, within reach, by either form: joints hold, and penalties take many times the iterations.
/ iterations, hand off by / {
  seen++
  match($0, /[0-9]+ iterations/); iterations[$1] = substr($0, RSTART, RLENGTH - 11) + 0
  expect($2 == "converged", "a pose that was found")
  between($NF, 0, 1e-9, "joints' error")
}
END {
  expect(seen == 2, "both forms")
  expect(iterations["penalties"] > 10 * iterations["constraints"], "ten times the iterations by penalties")
}
