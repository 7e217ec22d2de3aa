// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace veneer::projector {

/// Who a display says it is. Empty texts where it says nothing.
struct EdidIdentity {
  std::string maker;   ///< three letters, such as "SEC" for Seiko Epson
  std::string name;    ///< the monitor name of its descriptors
  std::string serial;  ///< of its descriptors, or else its serial number in decimal digits
};

/// Reads the first block of an EDID (VESA E-EDID Standard, Release A2, sections 3.4 and 3.10.3).
/// Bytes that are not an EDID give an empty identity; a wrong checksum is overlooked, since cheap
/// adapters have one and the names are for people.
[[nodiscard]] EdidIdentity read_edid(std::string_view bytes);

}  // namespace veneer::projector
