# Five frequencies beside those of beam theory: a solid is softer than a beam by its shear, and linear tets of this size are
# stiffer than the solid by a few per cent. A strike of J = 0.1 N·s along each of two axes on a corner gives every bending
# mode ½ J² · 4/m, as beams move by 2/√m at their ends; m = 0.785 kg.
BEGIN { GIVEN = 0.5 * 0.1 * 0.1 * 4 / 0.785 }
/^mode [0-9]/ {
  n++
  between($3 / $7, 0.95, 1.1, "frequency over that of beam theory")
  expect($3 > last, "frequencies in ascending order")
  between($9 / GIVEN, 0.95, 1.05, "energy of the mode over what beam theory gives it")
  last = $3
}
END { expect(n == 5, "five modes, found " n) }
