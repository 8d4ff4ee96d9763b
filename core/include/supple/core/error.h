/// @file supple/core/error.h
/// The three kinds of failure. A fault that the user can correct throws `Error`; a broken precondition fails SUPPLE_EXPECTS, which
/// throws `ContractViolation`; a numerical outcome is returned in a report and is no exception.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace supple {

/// Why a run stopped; the value is the exit code of the command line.
enum class ErrorKind : std::uint8_t {
  Internal = 1,  ///< an error of the program
  Usage = 2,     ///< a wrong argument
  Scene = 3,     ///< the scene file is invalid
  Io = 4,        ///< a file cannot be read or written
  Diverged = 5,  ///< values left their bounds
  Limit = 6,     ///< memory, size or step limits
  Corrupt = 7,   ///< a saved state or cache is damaged or belongs elsewhere
};

/// One thing that the user can correct: place, what was expected, what was found, and a hint.
struct Fault {
  std::string place{};     ///< "file:line:column", a path, or an argument; may be empty
  std::string key{};       ///< dotted key path, e.g. objects[0].skeleton[0].radius; may be empty
  std::string expected{};  ///< e.g. "expected a length > 0 [m]"; or the whole statement
  std::string found{};     ///< e.g. "-0.2"; may be empty
  std::string hint{};      ///< e.g. "did you mean 'radius'?"; may be empty

  /// place: key: expected, found FOUND; HINT   (without empty parts; control characters and invalid UTF-8 as a backslash, x and two digits)
  [[nodiscard]] std::string message() const;
};

/// Thrown for everything that the user can correct. Holds one fault or several of the same kind.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, Fault fault);
  /// @pre !faults.empty()
  Error(ErrorKind kind, std::vector<Fault> faults);

  [[nodiscard]] ErrorKind kind() const noexcept { return kind_; }
  [[nodiscard]] const std::vector<Fault>& faults() const noexcept { return faults_; }

 private:
  ErrorKind kind_;
  std::vector<Fault> faults_;
};

/// A precondition was broken by the calling code.
class ContractViolation : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

namespace detail {
[[noreturn]] void contract_failed(const char* condition, const char* file, int line);
}

}  // namespace supple

#define SUPPLE_EXPECTS(condition) \
  ((condition) ? static_cast<void>(0) : ::supple::detail::contract_failed(#condition, __FILE__, __LINE__))
