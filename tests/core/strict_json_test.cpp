#include "limber/internal/strict_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <functional>

namespace limber::internal {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

/// What reading a value under the key "x" of `{"x": text}` says.
std::string said_of(const std::string& text, const std::function<void(const JsonObject&)>& read) {
  return message_of([&] {
    const auto document = parse_json("{\"x\":" + text + "}", "\"f\"");
    read(JsonObject(document, "\"f\""));
  });
}

TEST(StrictJson, ReadsWhatIsThere) {
  const auto document =
      parse_json(R"({"n": -2.5e3, "i": 7, "b": true, "t": "text", "v": [1, 2, 3], "list": [{}, 4]})", "f");
  const JsonObject o(document, "f");
  EXPECT_EQ(o.number("n"), -2500.0);
  EXPECT_EQ(o.number("none", 3.0), 3.0);
  EXPECT_EQ(o.integer("i", 0, 7), 7);
  EXPECT_EQ(o.integer("none", 0, 7, 2), 2);
  EXPECT_TRUE(o.boolean("b", false));
  EXPECT_TRUE(o.boolean("none", true));
  EXPECT_EQ(o.text("t"), "text");
  EXPECT_EQ(o.vec3("v"), Vec3(1, 2, 3));
  std::vector<std::string> places;
  o.for_each("list", [&](const auto&, const std::string& place) { places.push_back(place); });
  EXPECT_THAT(places, ::testing::ElementsAre("f.list[0]", "f.list[1]"));
  o.finish();
}

TEST(StrictJson, SyntaxErrorsTellLineAndColumn) {
  EXPECT_THAT(message_of([] { parse_json("{\n  \"a\": 1,\n  b\n}", "\"f\""); }),
              AllOf(HasSubstr("\"f\": not valid JSON"), HasSubstr("line 3, column 3"), Not(HasSubstr("\n"))));
  for (const char* text :
       {"", "{", "{} {}", "{\"a\": NaN}", "{\"a\": 1e999}", "{'a': 1}", "// no\n{}", "{\"a\": \"\xff\"}"})
    EXPECT_THAT(message_of([&] { parse_json(text, "f"); }), HasSubstr("not valid JSON")) << text;
}

TEST(StrictJson, KeysThatStandTwiceAreRefusedAtAnyDepth) {
  EXPECT_THAT(message_of([] { parse_json(R"({"a": [{"b": {"": 1, "": 2}}]})", "f"); }),
              HasSubstr("the key \"\" stands twice"));
  EXPECT_EQ(message_of([] { parse_json(R"({"a": {"b": 1}, "c": {"b": 1, "d": [{"b": 2}]}})", "f"); }), "accepted");
}

TEST(StrictJson, UnknownKeysNameTheNearestKnownOne) {
  const auto document = parse_json(R"({"pioson_ratio": 1})", "f");
  const JsonObject o(document, "f");
  o.has("poisson_ratio"), o.has("density");
  EXPECT_THAT(message_of([&] { o.finish(); }),
              HasSubstr("the key \"pioson_ratio\" is unknown; did you mean \"poisson_ratio\"?"));
}

TEST(StrictJson, MissingKeysAreNamed) {
  EXPECT_THAT(said_of("1", [](const JsonObject& o) { o.number("y"); }), HasSubstr("\"f\": the key \"y\" is missing"));
}

TEST(StrictJson, AMissingKeyTellsWhatStandsThereInstead) {
  const auto document = parse_json(R"({"youngs_moduls": 1, "density": 2})", "f");
  EXPECT_THAT(message_of([&] { JsonObject(document, "f").number("youngs_modulus"); }),
              HasSubstr("\"youngs_modulus\" is missing; what stands there is \"youngs_moduls\""));
  EXPECT_THAT(message_of([&] { JsonObject(document, "f").number("poisson_ratio"); }),
              ::testing::EndsWith("\"poisson_ratio\" is missing"));
}

TEST(StrictJson, WrongTypesTellWhatWasSeenAndExpected) {
  EXPECT_THAT(said_of("\"1\"", [](const JsonObject& o) { o.number("x"); }),
              HasSubstr("\"f\".x: is \"1\", expected a finite number"));
  EXPECT_THAT(said_of("null", [](const JsonObject& o) { o.number("x"); }), HasSubstr("is null"));
  EXPECT_THAT(said_of("1.5", [](const JsonObject& o) { o.integer("x", 0, 9); }),
              HasSubstr("is 1.5, expected an integer from 0 to 9"));
  EXPECT_THAT(said_of("10", [](const JsonObject& o) { o.integer("x", 0, 9); }), HasSubstr("is 10"));
  EXPECT_THAT(said_of("1", [](const JsonObject& o) { o.boolean("x", true); }), HasSubstr("expected true or false"));
  EXPECT_THAT(said_of("{\"a\":1}", [](const JsonObject& o) { o.text("x"); }),
              HasSubstr("is an object of 1 keys, expected text"));
  EXPECT_THAT(said_of("[1,2]", [](const JsonObject& o) { o.vec3("x"); }),
              HasSubstr("is [1,2], expected an array of 3 numbers"));
  EXPECT_THAT(said_of("[1,2,\"3\"]", [](const JsonObject& o) { o.vec3("x"); }), HasSubstr("\"f\".x[2]: is \"3\""));
  EXPECT_THAT(said_of("3", [](const JsonObject& o) { o.for_each("x", [](const auto&, const auto&) {}); }),
              HasSubstr("expected an array"));
  EXPECT_THAT(message_of([] { JsonObject(parse_json("[]", "f"), "f"); }), HasSubstr("is [], expected an object"));
}

TEST(StrictJson, IntegersBeyond63BitsAreNotTakenForNegativeOnes) {
  const auto read = [](const JsonObject& o) { EXPECT_EQ(o.integer("x", -5, 5), 0) << "must not return"; };
  EXPECT_THAT(said_of("18446744073709551615", read), HasSubstr("expected an integer from -5 to 5"));
  EXPECT_THAT(said_of("9223372036854775808", read), HasSubstr("expected an integer from -5 to 5"));
}

TEST(StrictJson, MessagesStayShortAndOnOneLine) {
  const std::string nested = std::string(100000, '[') + std::string(100000, ']');
  EXPECT_THAT(said_of(nested, [](const JsonObject& o) { o.number("x"); }), HasSubstr("is an array of 1 items"));
  const std::string longish = "\"" + std::string(100000, 'a') + "\"";
  EXPECT_LT(said_of(longish, [](const JsonObject& o) { o.number("x"); }).size(), 200u);
  EXPECT_THAT(said_of("\"a\\nb\"", [](const JsonObject& o) { o.number("x"); }),
              AllOf(HasSubstr("\\n"), Not(HasSubstr("\n"))));
  const auto document = parse_json(R"({"a\nb": 1})", "f");
  EXPECT_THAT(message_of([&] { JsonObject(document, "f").finish(); }), Not(HasSubstr("\n")));
}

TEST(StrictJson, EditDistanceCountsInsertionsRemovalsAndReplacements) {
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);
  EXPECT_EQ(edit_distance("same", "same"), 0u);
  EXPECT_EQ(nearest_word("wod", {"steel", "wood", "glass"}), "wood");
  EXPECT_EQ(nearest_word("x", {}), "");
}

}  // namespace
}  // namespace limber::internal
