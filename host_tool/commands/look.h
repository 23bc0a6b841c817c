// Pages on this computer, by `look` and `web`. Before the process gives up its rights, a socket is prepared, and with
// --open a process that can start a browser.
#pragma once

#include <CLI/App.hpp>
#include <chrono>
#include <functional>

#include "host_tool/commands/command.h"
#include "host_tool/look/server.h"
#include "protocol/base/result.h"

namespace nodal::host {

inline constexpr const char *kLookCommand = "look", *kWebCommand = "web";
inline constexpr const char* kOpenFlag = "--open";
inline constexpr const char* kHeadsFlag = "--heads";

/// Sets `context.page`. Errors: those of look::prepare().
Status prepare_look(Context& context, const CLI::App& command);

struct ServedPage {
  bool open = false;     ///< whether a browser is started
  bool changes = false;  ///< it may POST
  look::Respond respond{};
  /// Gets the server when it has started, and null before it ends.
  std::function<void(look::Server*)> started{};
  const char* note = "";                                                    ///< how it ends
  std::chrono::milliseconds ends_after = std::chrono::milliseconds::max();  ///< without a page, after the last one
};
/// Prints the page's link and serves it on 127.0.0.1 until Ctrl-C or its end.
Status serve_page(Context& context, const ServedPage& page);

}  // namespace nodal::host
