// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/card_choice.h"

#include <algorithm>
#include <utility>

#include "projector/outputs/kms/display_choice.h"

namespace veneer::projector {

KmsCards cards_of_this_machine() { return {kms_device_paths(), open_kms_device}; }

Result<std::unique_ptr<KmsDevice>> choose_card(const KmsCards& cards, std::string_view connector) {
  if (cards.paths.empty())
    return fail(Errc::kNotFound,
                "there is no graphics card in /dev/dri; is its driver loaded, and may this "
                "service see it?");
  std::string list;
  bool opened = false;
  bool may_come = false;
  std::unique_ptr<KmsDevice> chosen;
  std::unique_ptr<KmsDevice> dark;  // has the socket, with nothing in it
  std::size_t fitting = 0;
  std::size_t so_named = 0;  // sockets
  for (const std::filesystem::path& path : cards.paths) {
    Result<std::unique_ptr<KmsDevice>> device = cards.open(path);
    const Result<std::vector<KmsConnector>> sockets =
        device ? sockets_of(**device) : tl::unexpected<Error>(device.error());
    // The first to open a card is its master, unasked; who is not gets no display asked.
    if (device) (*device)->drop_master();
    if (!sockets) {
      list += fmt::format("\n  {}: {}", path.string(), sockets.error().what);
      // A card that shows nothing will not hide a display; one that is not there yet may.
      if (device || sockets.error().code != Errc::kUnavailable) may_come = true;
      continue;
    }
    opened = true;
    list += list_of(path.string(), *sockets);
    if (sockets->empty() || std::ranges::any_of(*sockets, is_silent)) may_come = true;
    bool has_socket = false;
    bool has_display = false;
    for (const KmsConnector& each : *sockets) {
      if (!fits(each, connector)) continue;
      if (each.name == connector) ++so_named;
      (each.connected ? has_display : has_socket) = true;
    }
    if (has_display && fitting++ == 0) {
      chosen = std::move(*device);
    } else if (has_socket && !dark) {
      dark = std::move(*device);
    }
  }
  if (!opened) return fail(Errc::kUnavailable, "no card can show a picture:{}", list);
  // Which of them has a display just now must not decide: the projector may be off.
  if (!connector.empty() && std::max(fitting, so_named) > 1)
    return fail(Errc::kInvalidOption,
                "{} cards have a {} \"{}\"; set device too, to one of these:{}",
                std::max(fitting, so_named),
                so_named > 1 ? "socket" : "display",
                connector,
                list);
  if (chosen) return chosen;
  if (dark) return dark;
  return tl::unexpected<Error>(no_such_display(connector, "any card", may_come, list));
}

}  // namespace veneer::projector
