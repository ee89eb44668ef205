# Four seconds at thirty frames a second; the doll is not far from the man.
/^[0-9]+ poses; joints off by/ {
  told = 1
  between($1, 121, 121, "poses")
  between($6, 0, 1e-9, "joints' error")
  between($NF, 0, 0.2, "distance of a point")
}
END { expect(told, "what came of it") }
