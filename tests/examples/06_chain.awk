# Let go level the chain swings for half a minute: its joints hold and its energy goes, and never comes back.
/ s: energy / {
  n++
  if (n > 1) expect($4 <= last + 1e-5, "energy no more than before")
  if (n == 1) between($8, -0.01, 0.01, "tip at first, m")
  else between($8, -4.01, 4.01, "tip within the chain's length, m")
  if ($8 < lowest) lowest = $8
  last = $4
}
/^joints off by/ { held = 1; between($4, 0, 1e-9, "joints' error, m") }
END { expect(n == 7 && held, "seven moments and the joints"); expect(lowest < -1, "it swings down") }
