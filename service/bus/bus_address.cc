// SPDX-License-Identifier: Apache-2.0
#include "service/bus/bus_address.h"

#include "service/bus/command.h"

namespace veneer::service {

Result<BusAddress> BusAddress::parse(std::string_view text) {
  if (text == "system" || text == "session") return BusAddress(std::string(text));
  const std::size_t colon = text.find(':');
  const bool may_be_one = colon != std::string_view::npos && colon > 0 &&
                          text.find('=', colon) != std::string_view::npos &&
                          text == readable(text) && text.find('\n') == std::string_view::npos;
  if (!may_be_one)
    return fail(Errc::kInvalidOption,
                "\"{}\" is no message bus; say system, session or an address such as "
                "unix:path=/run/dbus/system_bus_socket",
                readable(text.substr(0, 200)));
  return BusAddress(std::string(text));
}

std::string BusAddress::name() const {
  if (text_ == "system" || text_ == "session") return "the " + text_ + " bus";
  return "the bus at " + text_;
}

}  // namespace veneer::service
