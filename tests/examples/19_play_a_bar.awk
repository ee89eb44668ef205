# The pitch within 1 % of F = 209,100 T/L², in inches. It rings after its last blow, at 2 s, until all is below 20 µPa: the lowest
# mode loses e^(-xi t), xi = 0.002 pi 817 Hz = 5.1 1/s.
/^lowest mode/ { between($3 / 816.8, 0.99, 1.01, "pitch over the calculated one"); n++ }
/modes to 20 kHz/ {
  between($1, 10, 60, "modes")
  rings = log($7 / 20e-6) / (0.002 * 3.14159 * 817)
  between($10 - 2, 0.5 * rings, 1.2 * rings, "seconds that it rings after its last blow")
  n++
}
END { expect(n == 2, "two lines, found " n) }
