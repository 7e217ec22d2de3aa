// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "base/result.h"
#include "calibration/exchange/internal_lcms.h"

namespace veneer::calibration {

std::string printable(std::string_view text, std::size_t longest) {
  std::string result(text.substr(0, longest));
  std::ranges::replace_if(
      result, [](char c) { return c < ' ' || c > '~'; }, '?');
  if (text.size() > longest) result += "...";
  return result;
}

LcmsContext::LcmsContext() : context_(cmsCreateContext(nullptr, this)) {
  VENEER_CHECK(context_ != nullptr);
  cmsSetLogErrorHandlerTHR(context_, &LcmsContext::keep);
}

void LcmsContext::keep(cmsContext context, cmsUInt32Number /*code*/, const char* text) {
  auto* self = static_cast<LcmsContext*>(cmsGetContextUserData(context));
  if (self != nullptr && self->message_.empty()) self->message_ = printable(text);
}

std::string LcmsContext::message() const { return message_.empty() ? "no reason given" : message_; }

}  // namespace veneer::calibration
