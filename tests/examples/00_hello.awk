# The crate falls as a stone does, 3 m less g t²/2, until a corner comes down; then it comes to lie flat on the ground.
/ height / {
  n++
  t = $1
  if (t <= 0.5) between($4, 3 - 4.903325 * t * t - 1e-3, 3 - 4.903325 * t * t + 1e-3, "height of a free fall, m")
  height = $4; tilt = $7
  between($4, 0.499, 3, "height, m")
}
END { expect(n == 21, "21 lines"); between(height, 0.499, 0.501, "height at last, m"); between(tilt, 0, 1e-3, "tilt at last") }
