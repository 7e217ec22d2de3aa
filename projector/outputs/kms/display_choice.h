// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "projector/outputs/kms/edid.h"
#include "projector/outputs/kms/kms_device.h"

namespace veneer::projector {

/// Which parts of a card show the picture on which display.
struct DisplayChoice {
  KmsConnector connector;
  EdidIdentity identity;
  KmsMode mode;
  KmsId crtc = 0;
  KmsPlane plane;  ///< the primary one
};

/// The connector of that name, or the connected one whose EDID has that monitor name or serial;
/// with an empty text, the only connected one. Errors: kInvalidOption (no such display though every
/// socket has one that says its name; or several: lists all), kUnavailable (none connected, or it
/// may be one that is off: lists all).
[[nodiscard]] Result<DisplayChoice> choose_display(KmsDevice& device,
                                                   std::string_view connector,
                                                   std::string_view mode);

/// "1920x1080" (the display's preferred rate, or else its first) or "1920x1080@60" (the nearest
/// rate within half a hertz); empty: the preferred mode, or else the first. Never an interlaced
/// one. Errors: kInvalidOption (lists the modes), kUnavailable (no modes, or those that the card
/// makes up where the display says nothing).
[[nodiscard]] Result<KmsMode> choose_mode(const KmsConnector& connector, std::string_view mode);

/// Every socket of a card, each display asked itself.
[[nodiscard]] Result<std::vector<KmsConnector>> sockets_of(KmsDevice& device);
/// Whether the text, as of choose_display(), means this socket or the display in it.
[[nodiscard]] bool fits(const KmsConnector& socket, std::string_view connector);
/// A projector that is off, or not yet awake, says neither its name nor its modes.
[[nodiscard]] bool is_silent(const KmsConnector& socket);
/// One line for each, with what is plugged in and its modes.
[[nodiscard]] std::string list_of(std::string_view path, const std::vector<KmsConnector>& sockets);
/// What is to be done where nothing fits.
/// @param may_come  not every display has said its name, so the text may be right.
[[nodiscard]] Error no_such_display(std::string_view connector,
                                    std::string_view where,
                                    bool may_come,
                                    std::string_view list);

/// "1920x1080@60.00".
[[nodiscard]] std::string name_of(const KmsMode& mode);
/// "HDMI-A-1: EPSON PJ, serial 1234".
[[nodiscard]] std::string name_of(const KmsConnector& connector);

}  // namespace veneer::projector
