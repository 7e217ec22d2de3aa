// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sdbus-c++/sdbus-c++.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/result.h"
#include "service/status.h"

namespace veneer::service {

/// A part of ServiceStatus as a property of the bus.
struct Property {
  std::string name;
  std::string signature;
  bool urgent = false;  ///< a change is signalled at once, others once a second at most
  std::function<void(sdbus::Message&, const ServiceStatus&)> append;
  std::function<bool(const ServiceStatus&, const ServiceStatus&)> same;
  /// Throws sdbus::Error where the variant holds another type.
  std::function<Status(const sdbus::Variant&, ServiceStatus&)> take;
};

/// All there are. Names and meaning are in docs/howto/service.md.
[[nodiscard]] const std::vector<Property>& properties();

/// What properties() said. What a newer service tells besides is left out; what an older one does
/// not tell stays as in ServiceStatus{}. Errors: kBadFormat (another type, or a name that no state
/// or fault has).
[[nodiscard]] Result<ServiceStatus> status_of(const std::map<std::string, sdbus::Variant>& values);

}  // namespace veneer::service
