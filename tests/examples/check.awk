# Read after NAME.awk, which reads what example NAME printed and says what its "see:" promises, in numbers:
#   expect(CONDITION, "what should be")        between(VALUE, LOW, HIGH, "of what")
function fail(text) { printf "%s: line %d: %s\n  %s\n", FILENAME, FNR, text, $0 > "/dev/stderr"; failed = 1 }
function expect(holds, text) { if (!holds) fail("expected " text) }
function between(value, low, high, what) {
  expect(value + 0 >= low && value + 0 <= high, what " between " low " and " high ", found " value)
}
END { exit failed }
