# The crate falls as a stone does, 3 m less g t²/2, until a corner comes down; then it comes to lie flat on the ground. The ball
# falls 0.7 m, bounces less high, and sags in the end: its middle is lower than its radius, its top lower than twice that.
/ crate at / {
  n++
  t = $1; crate = $5; ball = $9
  if (t <= 0.5) between(crate, 3 - 4.903325 * t * t - 1e-3, 3 - 4.903325 * t * t + 1e-3, "crate in free fall, m")
  if (t <= 0.3) between(ball, 1 - 4.903325 * t * t - 1e-3, 1 - 4.903325 * t * t + 1e-3, "ball in free fall, m")
  between(crate, 0.499, 3, "crate, m")
  if (t > 0.45 && ball > bounce) bounce = ball
}
/^a ray/ { met = 1; expect($7 == "ball", "the ball under the ray"); between($9, 0.5, 0.6, "its top, m") }
END {
  expect(n == 31 && met, "31 lines and a ray")
  between(crate, 0.499, 0.501, "crate at last, m"); between(bounce, 0.35, 1, "ball's bounce, m"); between(ball, 0.25, 0.3, "ball at last, m")
}
