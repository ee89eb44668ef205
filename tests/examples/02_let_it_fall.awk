# Dropped from 0.8 m: the corner is LOW below the origin, so the first hit is after √(2 (0.8 − LOW)/g).
BEGIN { LOW = 0.1392; FIRST = sqrt(2 * (0.8 - LOW) / 9.80665) }
/ s: hit / {
  n++
  if (n == 1) between($1, FIRST - 1 / 240, FIRST + 2 / 240, "seconds to the first hit")
  expect($4 == n ",", "hits counted")
  expect($5 > 0, "an impulse")
  if (n > 1) expect($(NF - 1) <= last, "energy no more than at the hit before")
  last = $(NF - 1)
}
/moved .* m in the last second/ {
  ended = 1
  between($4, 0.048, 0.052, "height of the origin of a block 0.1 m thick that lies")
  between($(NF - 5), 0, 1e-4, "way in the last second, m")
}
/^lowest vertex at/ { between($4, -3e-4, 3e-4, "lowest vertex, m"); between($(NF - 1), 0, 5e-3, "deepest, m") }
END { expect(n >= 3, "three hits or more, found " n); expect(ended, "an end") }
