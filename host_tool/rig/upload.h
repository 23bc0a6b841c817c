// Uploads a document to the rig; resumes when the link was lost.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "host_tool/console/console.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"

namespace nodal::host {

/// Makes a new connection to the same rig.
using Reconnect = std::function<Result<std::unique_ptr<RigConnection>>()>;

struct Uploaded {
  std::uint64_t bytes = 0;
  std::uint64_t resumed_at = 0;  ///< the rig had so much of it already
  int links = 1;                 ///< conversations it took
};

/// UploadBegin, the bytes from where the rig says on, UploadCommit with the signature, if there is one; with `trial`, for so long at most (ask for the rig's
/// feature first). A link that is lost (3xx) is made anew, up
/// to `attempts` conversations in all.
/// Errors: the last link's, or what the rig says of the document.
Result<Uploaded> upload(const Reconnect& connect, std::vector<std::uint8_t> document, int attempts, Console& console,
                        std::optional<Duration> trial = std::nullopt, const std::string& signature = "");

}  // namespace nodal::host
