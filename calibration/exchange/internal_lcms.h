// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <lcms2.h>

#include <memory>
#include <string>
#include <string_view>

// LittleCMS, with its messages kept. Not to be included by headers.
namespace veneer::calibration {

/// `text` with what is not printable ASCII replaced by '?', and cut after `longest` bytes: for what
/// a file says in our own messages.
[[nodiscard]] std::string printable(std::string_view text, std::size_t longest = 200);

/// A context of LittleCMS that keeps the first message. One thread.
class LcmsContext {
 public:
  LcmsContext();
  LcmsContext(const LcmsContext&) = delete;
  LcmsContext& operator=(const LcmsContext&) = delete;
  ~LcmsContext() { cmsDeleteContext(context_); }

  [[nodiscard]] cmsContext context() const { return context_; }
  /// "no reason given" where it said nothing.
  [[nodiscard]] std::string message() const;

 private:
  static void keep(cmsContext context, cmsUInt32Number code, const char* text);
  std::string message_;
  cmsContext context_;
};

struct CloseIt8 {
  void operator()(void* table) const { cmsIT8Free(table); }
};
using It8 = std::unique_ptr<void, CloseIt8>;

struct CloseProfile {
  void operator()(void* profile) const { cmsCloseProfile(profile); }
};
using IccProfile = std::unique_ptr<void, CloseProfile>;

struct FreeToneCurve {
  void operator()(cmsToneCurve* curve) const { cmsFreeToneCurve(curve); }
};
using ToneCurve = std::unique_ptr<cmsToneCurve, FreeToneCurve>;

struct FreePipeline {
  void operator()(cmsPipeline* pipeline) const { cmsPipelineFree(pipeline); }
};
using Pipeline = std::unique_ptr<cmsPipeline, FreePipeline>;

struct FreeText {
  void operator()(cmsMLU* text) const { cmsMLUfree(text); }
};
using IccText = std::unique_ptr<cmsMLU, FreeText>;

struct DeleteTransform {
  void operator()(void* transform) const { cmsDeleteTransform(transform); }
};
using IccTransform = std::unique_ptr<void, DeleteTransform>;

}  // namespace veneer::calibration
