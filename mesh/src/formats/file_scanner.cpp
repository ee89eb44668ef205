#include "formats/file_scanner.h"

#include <algorithm>
#include <charconv>
#include <system_error>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\f' || c == '\v'; }
bool is_line_end(char c) { return c == '\n' || c == '\r'; }

/// A number as other programs write it: a leading '+', a Fortran exponent (1.5D-3).
std::string plain_number(std::string_view word) {
  std::string plain(word.starts_with('+') && !word.starts_with("+-") ? word.substr(1) : word);
  std::replace_if(
      plain.begin(), plain.end(), [](char c) { return c == 'd' || c == 'D'; }, 'e');
  return plain;
}

}  // namespace

std::string lower_case(std::string_view word) {
  std::string out(word);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c; });
  return out;
}

std::string shown(std::string_view seen) {
  constexpr std::size_t kShown = 40;
  constexpr char kHex[] = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : seen.substr(0, kShown)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 32 && byte < 127)
      out += c;
    else
      out += {'\\', 'x', kHex[byte >> 4], kHex[byte & 15]};
  }
  return out + (seen.size() > kShown ? "...\"" : "\"");
}

std::string shown_path(const std::filesystem::path& path) {
  std::string out = path.string();
  std::replace_if(
      out.begin(), out.end(), [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; }, '?');
  return out.insert(0, 1, '"') + '"';
}

FileScanner::FileScanner(std::string_view bytes, std::string name, Syntax syntax)
    : bytes_(bytes), name_(std::move(name)), syntax_(syntax) {
  if (bytes.starts_with("\xef\xbb\xbf")) pos_ = 3;  // a byte order mark that some editors leave
}

void FileScanner::fail(const std::string& what) const {
  if (raw_) throw InputError(name_ + ": byte " + std::to_string(word_begin_) + ": " + what);
  fail_at(word_begin_, what);
}

void FileScanner::fail_at(std::size_t word, const std::string& what) const {
  // Counted only now: reading stays fast. Files without '\n' have lines that end in '\r' alone.
  const auto before = bytes_.substr(0, std::min(word, bytes_.size()));
  const char line_end = bytes_.find('\n') == std::string_view::npos ? '\r' : '\n';
  const auto line = 1 + std::count(before.begin(), before.end(), line_end);
  throw InputError(name_ + ": line " + std::to_string(line) + ": " + what);
}

bool FileScanner::ends_word(char c) const {
  return is_blank(c) || (syntax_.comment != 0 && c == syntax_.comment) ||
         (syntax_.continuation != 0 && c == syntax_.continuation);
}

std::size_t FileScanner::continued(std::size_t at) const {
  if (syntax_.continuation == 0 || bytes_[at] != syntax_.continuation) return 0;
  const auto rest = bytes_.substr(at + 1);
  if (rest.starts_with("\r\n")) return 3;
  return rest.starts_with('\n') || rest.starts_with('\r') ? 2 : 0;
}

void FileScanner::skip_line_blanks() {
  while (pos_ < bytes_.size()) {
    const char c = bytes_[pos_];
    if (is_blank(c) && !is_line_end(c)) {
      ++pos_;
    } else if (const auto length = continued(pos_); length > 0) {
      pos_ += length;
    } else if (syntax_.comment != 0 && c == syntax_.comment) {
      while (pos_ < bytes_.size() && !is_line_end(bytes_[pos_])) ++pos_;
    } else {
      return;
    }
  }
}

void FileScanner::skip_blanks() {
  skip_line_blanks();
  while (pos_ < bytes_.size() && is_line_end(bytes_[pos_])) {
    ++pos_;
    skip_line_blanks();
  }
}

bool FileScanner::at_end() {
  skip_blanks();
  return pos_ == bytes_.size();
}

std::string_view FileScanner::word(const char* expected) {
  skip_blanks();
  mark(false);
  if (pos_ == bytes_.size()) fail(std::string("the file ends, expected ") + expected);
  ++pos_;  // a stray continuation mark is a word of its own
  while (pos_ < bytes_.size() && !ends_word(bytes_[pos_])) ++pos_;
  return bytes_.substr(word_begin_, pos_ - word_begin_);
}

std::string_view FileScanner::peek_word() {
  if (at_end()) return {};
  const auto begin = pos_;
  const auto next = word("");
  pos_ = begin;
  return next;
}

void FileScanner::expect(std::string_view wanted) {
  const std::string text(wanted);
  const auto seen = word(text.c_str());
  if (seen != wanted) fail("seen " + shown(seen) + ", expected " + text);
}

bool FileScanner::more_on_line() {
  skip_line_blanks();
  return pos_ < bytes_.size() && !is_line_end(bytes_[pos_]);
}

void FileScanner::need_on_line(const char* expected) {
  if (more_on_line()) return;
  fail(std::string("the ") + (pos_ == bytes_.size() ? "file" : "line") + " ends, expected " + expected);
}

std::string_view FileScanner::rest_of_line() {
  auto begin = pos_;
  while (pos_ < bytes_.size() && !is_line_end(bytes_[pos_])) ++pos_;
  auto end = pos_;
  if (bytes_.substr(pos_).starts_with("\r\n")) ++pos_;
  if (pos_ < bytes_.size()) ++pos_;
  while (begin < end && is_blank(bytes_[begin])) ++begin;
  while (begin < end && is_blank(bytes_[end - 1])) --end;
  return bytes_.substr(begin, end - begin);
}

void FileScanner::end_line(const char* after) {
  while (pos_ < bytes_.size() && (bytes_[pos_] == ' ' || bytes_[pos_] == '\t')) ++pos_;
  if (bytes_.substr(pos_).starts_with("\r\n")) ++pos_;
  if (pos_ == bytes_.size() || bytes_[pos_] != '\n') {
    mark(false);
    fail(std::string("expected the line's end after ") + after);
  }
  ++pos_;
}

bool FileScanner::skip_to_line(std::string_view start) {
  mark(false);
  for (auto at = bytes_.find(start, pos_); at != std::string_view::npos; at = bytes_.find(start, at + 1)) {
    if (at > 0 && !is_line_end(bytes_[at - 1])) continue;
    pos_ = at;
    return true;
  }
  pos_ = bytes_.size();
  return false;
}

double FileScanner::real(const char* expected) {
  skip_blanks();
  mark(false);
  double value = 0.0;
  const char* const end = bytes_.data() + bytes_.size();
  const auto [p, error] = std::from_chars(bytes_.data() + pos_, end, value);
  if (error != std::errc() || !std::isfinite(value) || (p != end && !ends_word(*p))) return unusual_real(expected);
  pos_ = static_cast<std::size_t>(p - bytes_.data());
  return value;
}

std::int64_t FileScanner::integer(const char* expected) {
  skip_blanks();
  mark(false);
  std::int64_t value = 0;
  const char* const end = bytes_.data() + bytes_.size();
  const auto [p, error] = std::from_chars(bytes_.data() + pos_, end, value);
  if (error != std::errc() || (p != end && !ends_word(*p))) return unusual_integer(expected);
  pos_ = static_cast<std::size_t>(p - bytes_.data());
  return value;
}

std::int64_t FileScanner::integer(std::int64_t low, std::int64_t high, const char* expected) {
  const auto value = integer(expected);
  if (value < low || value > high)
    fail("seen " + std::to_string(value) + ", expected " + expected + " from " + std::to_string(low) + " to " +
         std::to_string(high));
  return value;
}

double FileScanner::unusual_real(const char* expected) {
  const auto seen = word(expected);
  const auto plain = plain_number(seen);
  double value = 0.0;
  const char* const end = plain.data() + plain.size();
  const auto [p, error] = std::from_chars(plain.data(), end, value);
  if (p == end && error == std::errc::result_out_of_range && plain.find('-', 1) != std::string::npos)
    return 0.0;  // below the smallest double: 1e-400
  if (p != end || error != std::errc() || !std::isfinite(value))
    fail("seen " + shown(seen) + ", expected " + expected + " (finite)");
  return value;
}

std::int64_t FileScanner::unusual_integer(const char* expected) {
  const auto seen = word(expected);
  const auto plain = plain_number(seen);
  std::int64_t value = 0;
  const char* const end = plain.data() + plain.size();
  const auto [p, error] = std::from_chars(plain.data(), end, value);
  if (p != end || error != std::errc()) fail("seen " + shown(seen) + ", expected " + expected + " (an integer)");
  return value;
}

void FileScanner::skip_bytes(std::uint64_t count, const char* expected) {
  mark(true);
  if (count > remaining()) fail(std::string("the file ends, expected ") + expected);
  pos_ += static_cast<std::size_t>(count);
}

Index FileScanner::checked_count(std::int64_t count, std::size_t least_bytes, const char* items) const {
  if (count < 0) fail("seen " + std::to_string(count) + " as the " + items + ", expected 0 or more");
  if (static_cast<std::uint64_t>(count) > remaining() / least_bytes)
    fail("seen " + std::to_string(count) + " as the " + items + ", but only " + std::to_string(remaining()) +
         " bytes follow: wrong, or the file is cut short");
  if (count > std::numeric_limits<Index>::max())
    fail("seen " + std::to_string(count) + " as the " + items + ", expected at most 2147483647");
  return static_cast<Index>(count);
}

}  // namespace limber::internal
