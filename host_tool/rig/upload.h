// Uploads a document to the rig; continues after a lost link.
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
  std::uint64_t resumed_at = 0;  ///< bytes that the rig already had
  int links = 1;                 ///< connections that were used
};

/// How a document is to be taken.
struct UploadTerms {
  /// The calibration is on trial for at most that time; check the rig's feature first.
  std::optional<Duration> trial{};
  std::string signature{};   ///< signature of the document; empty: not signed
  bool allow_older = false;  ///< a signature of an older generation is accepted, too
};

/// Sends UploadBegin, the bytes from the offset that the rig answers, and UploadCommit with the terms. Reconnects after
/// a lost link (3xx), up to `attempts` connections in total.
/// Errors: the last connection's, or the rig's refusal of the document.
Result<Uploaded> upload(const Reconnect& connect, std::vector<std::uint8_t> document, int attempts, Console& console,
                        const UploadTerms& terms = {});

}  // namespace nodal::host
