// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <tl/expected.hpp>

#include <string>
#include <utility>

namespace veneer {

/// What kind of thing went wrong. The command line maps kInvalidOption to exit code 2 (wrong usage)
/// and everything else to 1.
enum class Errc {
  kNotFound,       ///< a file, device or key that is not there
  kIo,             ///< the system refused to read or write
  kBadFormat,      ///< data that are there but damaged, inconsistent or not understood
  kInvalidOption,  ///< a value that the user gave and can correct
  kUnavailable,    ///< something this machine does not offer (a GL version, a display)
  kTimeout,        ///< try again
  kDisconnected,   ///< final for this handle; open again
  kCancelled,      ///< the user asked to stop
};

/// An expected failure. `what` says what was being done, what went wrong and what to do about it.
struct Error {
  Errc code;
  std::string what;
};

/// A value or the reason why there is none. Mark functions that return one [[nodiscard]].
template <class T>
using Result = tl::expected<T, Error>;
using Status = Result<void>;

/// An error with a formatted text: `return fail(Errc::kBadFormat, "reading {}: {}", path, why);`
template <class... Args>
[[nodiscard]] tl::unexpected<Error> fail(Errc code,
                                         fmt::format_string<Args...> text,
                                         Args&&... args) {
  return tl::unexpected<Error>(Error{code, fmt::format(text, std::forward<Args>(args)...)});
}

/// Prefixes an error with what was being done, on its way up.
[[nodiscard]] inline tl::unexpected<Error> fail_while(std::string_view doing, const Error& error) {
  return tl::unexpected<Error>(Error{error.code, fmt::format("{}: {}", doing, error.what)});
}

/// Ends the program with a message: for bugs of ours, never for bad input.
[[noreturn]] void check_failed(const char* condition, const char* file, int line);

}  // namespace veneer

/// Aborts unless `condition` holds; for bugs of ours, never for bad input.
#define VENEER_CHECK(condition) \
  ((condition) ? void(0) : ::veneer::check_failed(#condition, __FILE__, __LINE__))

#define VENEER_CONCAT_INNER(a, b) a##b
#define VENEER_CONCAT(a, b) VENEER_CONCAT_INNER(a, b)

/// Returns the error of a Status or Result to the caller, if there is one.
#define VENEER_TRY(expression)                                                    \
  do {                                                                            \
    if (auto veneer_status = (expression); !veneer_status)                        \
      return ::tl::unexpected<::veneer::Error>(std::move(veneer_status).error()); \
  } while (false)

/// `VENEER_ASSIGN(auto file, open(path));` declares or assigns the value, or returns the error.
#define VENEER_ASSIGN(declaration, expression) \
  VENEER_ASSIGN_INNER(VENEER_CONCAT(veneer_result_, __LINE__), declaration, expression)
#define VENEER_ASSIGN_INNER(result, declaration, expression)                        \
  auto result = (expression);                                                       \
  if (!result) return ::tl::unexpected<::veneer::Error>(std::move(result).error()); \
  declaration = std::move(*result)
