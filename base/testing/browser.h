// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <string>
#include <string_view>
#include <utility>

#include "base/files.h"
#include "base/result.h"
#include "base/testing/temporary_folder.h"

// For tests: what a page is like in a real browser without a window.
namespace veneer {

/// Whether there is one; why a test skips where there is none.
inline bool has_browser() { return std::system("command -v chromium >/dev/null 2>&1") == 0; }
constexpr const char* kNoBrowser = "chromium is not installed; apt-get install chromium";

/// Opens an HTML page and lets a hand at it.
/// @param page  one file that needs no other: all it asks for, but `data:`, is refused and told of.
/// @param hand  the body of an async function, in JavaScript, that runs once the page's own scripts
///   have: it clicks, looks, and returns what it found.
/// @return  JSON: {"found": what the hand returned, "faults": [texts: what went wrong in page or
///   hand, what the page wrote to the console as a warning or an error, what it asked of a network
///   or a disk]}.
/// Errors: kIo (no browser), kBadFormat (no page, or it hangs).
inline Result<std::string> seen_in_browser(std::string page, std::string_view hand) {
  constexpr std::string_view kWatch = R"(<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:">
<script>{
const faults = window.faultsSeen = [];
addEventListener('error', e => faults.push(e.message || `not loaded: ${e.target.src || e.target.href}`), true);
addEventListener('unhandledrejection', e => faults.push(String(e.reason)));
document.addEventListener('securitypolicyviolation', e => faults.push(`asked for ${e.blockedURI}`));
for (const level of ['error', 'warn']) console[level] = (...words) => faults.push(words.join(' '));
}</script>)";
  constexpr std::string_view kHead = "<head>";
  const std::size_t head = page.find(kHead);
  const std::size_t end = page.rfind("</body>");
  if (head == std::string::npos || end == std::string::npos || end < head)
    return fail(Errc::kBadFormat, "opening a page: it has no <head> or no </body>");
  page.insert(end,
              fmt::format(R"(<script>(async () => {{ {}
}})().catch(error => {{ faultsSeen.push(String(error)); }}).then(found => {{
  const pre = document.createElement('pre');
  pre.id = 'found';
  pre.textContent = JSON.stringify({{ found, faults: faultsSeen }});
  document.body.append(pre);
}});</script>)",
                          hand));
  page.insert(head + kHead.size(), kWatch);

  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "page.html";
  const std::filesystem::path dom = folder.path() / "dom.html";
  VENEER_TRY(write_text(file, page));
  const std::string command = fmt::format(
      "HOME='{0}' timeout 120 chromium --headless --no-sandbox --disable-gpu "
      "--disable-dev-shm-usage --user-data-dir='{0}/chromium' --virtual-time-budget=10000 "
      "--dump-dom 'file://{1}' >'{2}' 2>/dev/null </dev/null",
      folder.path().string(),
      file.string(),
      dom.string());
  if (std::system(command.c_str()) != 0) return fail(Errc::kIo, "opening a page: chromium failed");
  VENEER_ASSIGN(const std::string text, read_text(dom));
  constexpr std::string_view kBegin = "<pre id=\"found\">";
  const std::size_t begin = text.rfind(kBegin);
  if (begin == std::string::npos)
    return fail(Errc::kBadFormat, "opening a page: its scripts did not come to an end: {}", text);
  const std::size_t from = begin + kBegin.size();
  std::string found = text.substr(from, text.find("</pre>", from) - from);
  for (const auto& [entity, plain] :
       {std::pair("&lt;", "<"), std::pair("&gt;", ">"), std::pair("&amp;", "&")})
    for (std::size_t at = 0; (at = found.find(entity, at)) != std::string::npos;)
      found.replace(at, std::string_view(entity).size(), plain);
  return found;
}

}  // namespace veneer
