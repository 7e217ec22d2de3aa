// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/kms/displays.h"

#include "projector/outputs/kms/display_choice.h"
#include "projector/outputs/kms/kms_device.h"

namespace veneer::projector {
namespace {

Status add_displays(const std::filesystem::path& path, std::vector<KmsDisplay>& displays) {
  VENEER_ASSIGN(const std::unique_ptr<KmsDevice> device, open_kms_device(path));
  VENEER_ASSIGN(const KmsResources resources, device->resources());
  for (const KmsId id : resources.connectors) {
    VENEER_ASSIGN(const KmsConnector connector, device->connector(id, true));
    VENEER_ASSIGN(const auto properties, device->properties(id, KmsKind::kConnector));
    const KmsProperty* crtc = find_property(properties, "CRTC_ID");
    const EdidIdentity identity = read_edid(connector.edid);
    KmsDisplay display;
    display.device = device->path();
    display.driver = device->driver();
    display.connector = connector.name;
    display.connected = connector.connected;
    display.in_use = crtc != nullptr && crtc->value != 0;
    display.maker = identity.maker;
    display.name = identity.name;
    display.serial = identity.serial;
    for (const KmsMode& mode : connector.modes) {
      if (!mode.interlaced) display.modes.push_back(name_of(mode));
    }
    displays.push_back(std::move(display));
  }
  return {};
}

}  // namespace

Result<std::vector<KmsDisplay>> kms_displays() {
  std::vector<KmsDisplay> displays;
  Status all = fail(Errc::kNotFound,
                    "looking for displays: there is no graphics card in /dev/dri; is its driver "
                    "loaded?");
  for (const std::filesystem::path& path : kms_device_paths()) {
    const Status added = add_displays(path, displays);
    if (!added) all = fail_while("looking for displays", added.error());
  }
  if (displays.empty() && !all) return tl::unexpected<Error>(std::move(all).error());
  return displays;
}

}  // namespace veneer::projector
