// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "projector/control.h"

// What PJLink says and is told, line by line; nothing of how it is transported.
//
// ASCII; every line ends with CR. The projector greets; a request is "%1POWR ?", its reply
// "%1POWR=0". Source: the PJLink specifications, class 1 and 2 (JBMIA), as eight public
// implementations show them; no code of theirs was taken.
namespace veneer::projector::pjlink {

/// Characters of a line before its CR: header 7, parameter 128 (from memory of the specification),
/// and room for devices that say more. A longer one is garbage.
inline constexpr std::size_t kLongestLine = 512;

/// The first line of a connection, without its CR.
struct Greeting {
  std::optional<std::string> seed;  ///< a password is wanted, mixed with it
};
/// Errors: kInvalidOption ("PJLINK ERRA", which is no greeting but a refusal), kBadFormat.
[[nodiscard]] Result<Greeting> read_greeting(std::string_view line);

/// What goes before the first request of a connection: MD5 of seed and password, 32 lower-case
/// hexadecimal digits.
[[nodiscard]] std::string digest(std::string_view seed, std::string_view password);

/// @param letters  four: "POWR".
/// @param parameter  "?" asks.
struct Request {
  int protocol_class = 1;
  std::string letters;
  std::string parameter;
};
/// With its CR, without a digest.
[[nodiscard]] std::string line_of(const Request& request);

/// What a projector says to a request.
struct Reply {
  std::string parameter;  ///< "OK" for a command that was accepted
  int refusal = 0;        ///< 1 to 4 for "ERR1" to "ERR4"; 0: it was not refused
};
/// Of a line without its CR. Errors: kInvalidOption (ERRA: the password is wrong), kBadFormat (no
/// reply to this request).
[[nodiscard]] Result<Reply> read_reply(std::string_view line, const Request& request);
/// What a refusal means and what to do: kUnavailable (ERR1: it does not know the command; ERR3: not
/// now), kInvalidOption (ERR2: it does not take the parameter), kIo (ERR4: it has failed).
[[nodiscard]] Error error_of(const Reply& refused, const Request& request);

// Parameters of replies. Errors: kBadFormat.
[[nodiscard]] Result<Power> read_power(std::string_view parameter);
/// Whether the picture is muted; of "11", "10", "21", "20", "31", "30".
[[nodiscard]] Result<bool> read_mute(std::string_view parameter);
/// Six digits: fan, lamp, temperature, cover, filter, other.
[[nodiscard]] Result<std::map<std::string, Health>> read_health(std::string_view parameter);
/// "1234 1 99 0": hours and whether it burns, 1 to 8 lamps.
[[nodiscard]] Result<std::vector<Lamp>> read_lamps(std::string_view parameter);
/// "1920x1080", of an input (IRES) or the panel (RRES). Nothing for all else: how these look is
/// from memory, and one that looks otherwise must not cost the rest of the state.
[[nodiscard]] std::optional<Resolution> read_resolution(std::string_view parameter);
/// What IRES says where nothing comes in.
inline constexpr std::string_view kNoSignal = "-";
[[nodiscard]] Result<bool> read_flag(std::string_view parameter);

/// "31" as "digital1". Errors: kBadFormat.
[[nodiscard]] Result<std::string> input_name(std::string_view code);
/// "digital1", or the code itself, as "31". Kinds: rgb, video, digital, storage, network, internal
/// (class 2); numbers 1 to 9, and A to Z in class 2. Errors: kInvalidOption.
[[nodiscard]] Result<std::string> input_code(std::string_view name);

/// What a projector of class 2 answers to a search, a datagram: its MAC address, in lower case.
/// Errors: kBadFormat.
[[nodiscard]] Result<std::string> read_acknowledgement(std::string_view datagram);

/// A text for people: UTF-8 as it came, bytes that are none of it as '?'.
[[nodiscard]] std::string readable(std::string_view text);

}  // namespace veneer::projector::pjlink
