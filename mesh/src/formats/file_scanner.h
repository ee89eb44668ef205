/// Reads a mesh file held in memory: words and numbers of text, and raw numbers of either byte order. Every reader of
/// limber stands on it, so that every slip in a file is told the same way: `"name": line N: seen "12abc", expected …`.
#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>

#include "limber/core/types.h"

namespace limber::internal {

/// How the numbers of a section are written.
enum class Encoding { kText, kLittleEndian, kBigEndian };

/// "…" with everything that could break the one line of a message made visible, cut after 40 characters.
std::string shown(std::string_view seen);

/// A file's whole name for messages, in quotes, on one line whatever it is made of.
std::string shown_path(const std::filesystem::path& path);

/// A word with the capitals of ASCII made small.
std::string lower_case(std::string_view word);

class FileScanner {
 public:
  /// Special characters of a format's text; 0: none.
  struct Syntax {
    char comment = 0;       ///< from here to the end of the line nothing is read
    char continuation = 0;  ///< before a line end: the line goes on
  };

  /// @param bytes outlives the scanner. @param name of the file, quoted, for messages.
  FileScanner(std::string_view bytes, std::string name, Syntax syntax);

  const std::string& name() const { return name_; }
  std::size_t position() const { return pos_; }
  std::size_t remaining() const { return bytes_.size() - pos_; }

  /// Throws InputError: name, line of the last word read (offset of the last raw number), then `what`.
  [[noreturn]] void fail(const std::string& what) const;
  /// A position that fail_at() can turn into a line later, when a slip shows only then.
  std::size_t last_word() const { return word_begin_; }
  [[noreturn]] void fail_at(std::size_t word, const std::string& what) const;

  // Words, on this line or a later one.
  bool at_end();  ///< nothing but blanks and comments follows
  std::string_view word(const char* expected);
  std::string_view peek_word();  ///< empty at the end
  void expect(std::string_view word);

  bool starts_with(std::string_view text) const { return bytes_.substr(pos_).starts_with(text); }

  // Lines.
  bool more_on_line();                      ///< another word stands before the line's end
  void need_on_line(const char* expected);  ///< fails if none does
  std::string_view rest_of_line();          ///< without blanks at its ends; moves behind the line end
  void end_line(const char* after);         ///< passes the line end that must follow, and nothing more
  /// Moves to the next line that begins so; false (at the end) if none does.
  bool skip_to_line(std::string_view start);

  // Numbers. A number is read whole or refused: no "12abc", no NaN, no infinity.
  double real(const char* expected = "a number");
  std::int64_t integer(const char* expected = "an integer");
  std::int64_t integer(std::int64_t low, std::int64_t high, const char* expected);

  /// One number as text or bytes. Text is checked for range and finiteness; bytes are taken as they are.
  template <class T>
  T number(Encoding encoding, const char* expected) {
    if (encoding != Encoding::kText) return raw<T>(encoding, expected);
    if constexpr (std::floating_point<T>) {
      return static_cast<T>(real(expected));
    } else {
      // An unsigned 64-bit value above 2⁶³ has no use in a mesh.
      constexpr auto kHigh = sizeof(T) == 8 ? std::numeric_limits<std::int64_t>::max()
                                            : static_cast<std::int64_t>(std::numeric_limits<T>::max());
      return static_cast<T>(integer(static_cast<std::int64_t>(std::numeric_limits<T>::min()), kHigh, expected));
    }
  }

  void skip_bytes(std::uint64_t count, const char* expected);

  /// Checks a count from the file against what is left of it, before anything is allocated.
  /// @param least_bytes the fewest bytes that one item can take
  Index checked_count(std::int64_t count, std::size_t least_bytes, const char* items) const;
  Index count(std::size_t least_bytes, const char* items) { return checked_count(integer(items), least_bytes, items); }

 private:
  template <class T>
  T raw(Encoding encoding, const char* expected) {
    mark(true);
    if (remaining() < sizeof(T)) fail(std::string("the file ends, expected ") + expected);
    char copy[sizeof(T)];
    const bool swap = (encoding == Encoding::kBigEndian) == (std::endian::native == std::endian::little);
    for (std::size_t i = 0; i < sizeof(T); ++i) copy[swap ? sizeof(T) - 1 - i : i] = bytes_[pos_ + i];
    pos_ += sizeof(T);
    T value;
    std::memcpy(&value, copy, sizeof(T));
    return value;
  }

  void mark(bool raw) {
    word_begin_ = pos_;
    raw_ = raw;
  }
  bool ends_word(char c) const;
  void skip_blanks();                           // and comments, over any number of lines
  void skip_line_blanks();                      // and comments, up to the line's end
  std::size_t continued(std::size_t at) const;  // length of a continuation and its line end at `at`, or 0
  double unusual_real(const char* expected);
  std::int64_t unusual_integer(const char* expected);

  std::string_view bytes_;
  std::string name_;
  Syntax syntax_;
  std::size_t pos_ = 0;
  std::size_t word_begin_ = 0;
  bool raw_ = false;  // what begins at word_begin_ is bytes, not text
};

}  // namespace limber::internal
