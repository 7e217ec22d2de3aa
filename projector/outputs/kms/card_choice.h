// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "projector/outputs/kms/kms_device.h"

namespace veneer::projector {

/// The display cards of a machine, and how one is opened.
struct KmsCards {
  std::vector<std::filesystem::path> paths;
  std::function<Result<std::unique_ptr<KmsDevice>>(const std::filesystem::path&)> open;
};
[[nodiscard]] KmsCards cards_of_this_machine();

/// The card with the display that choose_display() takes for this connector; with an empty text,
/// the first that has any. Only the card that is chosen stays open. Errors, all with a list of
/// every socket of every card: kNotFound (no card), kInvalidOption (no such display though every
/// socket has one that says its name; or several cards have such a display or socket), kUnavailable
/// (none connected, or it may be one that is off or of a card that cannot be opened).
[[nodiscard]] Result<std::unique_ptr<KmsDevice>> choose_card(const KmsCards& cards,
                                                             std::string_view connector);

}  // namespace veneer::projector
