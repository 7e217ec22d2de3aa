// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.h"

namespace veneer::capture::elliptec {

// Texts of Thorlabs' ELLx modules, 9600 baud, 8N1: a digit of an address (0 to F), two letters,
// upper-case hexadecimal digits; answers end with CR LF, requests with nothing. Written from
// memory of Thorlabs' "ELLx modules protocol manual"; the codes of the status and the places of the
// information agree with what public drivers of others read. No real stage has been tried.

struct Reply {
  char address = '0';
  std::string command;  ///< two letters: "PO", "GS", "IN"
  std::string data;
};
/// @param line  without its end. Errors: kBadFormat (it shows what came).
[[nodiscard]] Result<Reply> parse_reply(std::string_view line);

struct Information {
  int type = 0;  ///< 14 for an ELL14
  std::string serial_number;
  int travel = 0;                           ///< degrees of a rotation stage
  std::uint32_t pulses_per_revolution = 0;  ///< 143360 of an ELL14

  [[nodiscard]] bool is_rotation_stage() const;
};
/// Of an answer "IN". Errors: kBadFormat.
[[nodiscard]] Result<Information> parse_information(const Reply& reply);
/// Of an answer "PO": pulses, may be negative. Errors: kBadFormat.
[[nodiscard]] Result<std::int32_t> parse_position(const Reply& reply);
/// Of an answer "GS". Errors: kBadFormat.
[[nodiscard]] Result<int> parse_status(const Reply& reply);

inline constexpr int kStatusGood = 0;
inline constexpr int kStatusBusy = 9;
/// What a status means and what to do about it.
[[nodiscard]] std::string text_of_status(int status);

/// "0ma0000A000"
[[nodiscard]] std::string move_request(char address, std::int32_t pulses);

}  // namespace veneer::capture::elliptec
