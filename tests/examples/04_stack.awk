# Five boxes come to sleep where they were laid, and cost nothing then; a strike wakes all; they come to sleep again.
/ asleep, / {
  settled++
  expect($3 == 5 && $5 == 5, "5 of 5 asleep")
  between($7, 0, 0, "rows of a stack that sleeps")
}
/^ *box [0-4] at/ { boxes++; between($6, -1e-3, 1e-3, "height off, m"); between($NF == "rad" ? $(NF - 1) : 1, 0, 1e-3, "tilt, rad") }
/^struck/ { struck = 1; expect($4 == "is" && $5 == "awake,", "the highest is awake"); between($6, 1, 1e4, "rows"); between($8, 1e-6, 10, "energy in modes, J") }
END { expect(settled == 2 && boxes == 10 && struck, "two settled stacks of five and a strike") }
