/// @file limber/core/error.h
/// The exceptions that limber throws, for errors of a caller or a file. `assert` is for limber's own slips.
///
/// A message says where, which element, the value seen, what was expected and what to try, in one line.
#pragma once

#include <stdexcept>
#include <string>

namespace limber {

/// Base of everything limber throws on purpose.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An argument of a public function is outside its documented range. Programs exit with code 2.
class InvalidArgument : public Error {
 public:
  using Error::Error;
};

/// A file cannot be read or written, or holds something wrong. Programs exit with code 1.
class InputError : public Error {
 public:
  using Error::Error;
};

/// The input was well formed but the computation cannot give a right answer. Programs exit with code 1.
class ComputationError : public Error {
 public:
  using Error::Error;
};

}  // namespace limber
