// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/edid.h"

#include <cstddef>
#include <cstdint>

namespace veneer::projector {
namespace {

constexpr std::size_t kBlockBytes = 128;
constexpr std::string_view kHeader("\x00\xff\xff\xff\xff\xff\xff\x00", 8);
constexpr std::size_t kFirstDescriptor = 54;
constexpr std::size_t kDescriptorBytes = 18;
constexpr std::size_t kDescriptors = 4;
constexpr std::size_t kTextBegin = 5;
constexpr std::uint8_t kNameTag = 0xfc;
constexpr std::uint8_t kSerialTag = 0xff;

/// Up to a line feed, without what no terminal should be sent and without spaces at the end.
std::string text_of(std::string_view field) {
  std::string text;
  for (const char c : field) {
    if (c == '\n' || c == '\0') break;
    if (c >= 0x20 && c < 0x7f) text += c;
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

}  // namespace

EdidIdentity read_edid(std::string_view bytes) {
  EdidIdentity identity;
  if (bytes.size() < kBlockBytes || !bytes.starts_with(kHeader)) return identity;
  const auto byte = [bytes](std::size_t i) { return static_cast<std::uint8_t>(bytes[i]); };
  // Five bits a letter, 1 for A, in two bytes of which the higher comes first.
  const unsigned letters = (unsigned{byte(8)} << 8U) | byte(9);
  for (const unsigned shift : {10U, 5U, 0U}) {
    const unsigned letter = (letters >> shift) & 31U;
    if (letter >= 1 && letter <= 26) identity.maker += static_cast<char>('A' + letter - 1);
  }
  for (std::size_t i = 0; i < kDescriptors; ++i) {
    const std::size_t at = kFirstDescriptor + i * kDescriptorBytes;
    // Two zeros where a timing would have its pixel clock.
    if (byte(at) != 0 || byte(at + 1) != 0) continue;
    const std::string_view field = bytes.substr(at + kTextBegin, kDescriptorBytes - kTextBegin);
    if (byte(at + 3) == kNameTag) identity.name = text_of(field);
    if (byte(at + 3) == kSerialTag) identity.serial = text_of(field);
  }
  const std::uint32_t number = byte(12) | (std::uint32_t{byte(13)} << 8U) |
                               (std::uint32_t{byte(14)} << 16U) | (std::uint32_t{byte(15)} << 24U);
  if (identity.serial.empty() && number != 0) identity.serial = std::to_string(number);
  return identity;
}

}  // namespace veneer::projector
