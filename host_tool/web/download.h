// A part of a take's file on its way from the rig to a browser.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "host_tool/look/server.h"
#include "host_tool/web/header_values.h"
#include "host_tool/web/rig_desk.h"

namespace nodal::host::web {

/// Downloads, each over a connection of its own to the rig, because a rig reads one file for each host.
///
/// Threading: start() for any thread; `wake` is called on the downloads' threads.
/// Ownership: the threads end with their downloads; wait() waits for them.
/// Errors: start(): kOverload beyond kMaxDownloads.
class Downloads {
 public:
  Downloads(RigDesk::Connect connect, std::function<void()> wake);
  ~Downloads();
  Downloads(const Downloads&) = delete;
  Downloads& operator=(const Downloads&) = delete;

  /// Bytes of a file of a take. The rig is asked when the first of them are read.
  Result<std::shared_ptr<look::Pieces>> start(std::uint64_t take, const std::string& file, const ByteRange& range);

  static constexpr std::size_t kMaxDownloads = 3;
  static constexpr std::size_t kMaxWaiting = 2;  ///< pieces of 1 MiB that wait for the browser, for each download

 private:
  struct Shared;
  class Download;
  std::shared_ptr<Shared> shared_;
};

}  // namespace nodal::host::web
