// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace veneer::service {

/// What veneerd is called on a message bus. etc/dbus-1/org.veneer.Veneer1.conf says who may do what
/// under these names; docs/howto/service.md lists what is found there.
inline constexpr char kBusName[] = "org.veneer.Veneer1";
inline constexpr char kObjectPath[] = "/org/veneer/Veneer1";
inline constexpr char kInterface[] = "org.veneer.Veneer1";

}  // namespace veneer::service
