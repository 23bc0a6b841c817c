// The part of Session that opens, fills and closes its own streams.
#include <algorithm>
#include <utility>

#include "protocol/base/try.h"
#include "protocol/session.h"

namespace nodal {

Result<StreamId> Session::open_stream(StreamPolicy policy) {
  if (dead_) return fail(*dead_);
  NODAL_TRY_ASSIGN(const auto stream, sender_.open(policy));
  wire::StreamOpen message;
  message.set_policy(static_cast<std::uint32_t>(policy));
  push_control(FrameType::kStreamOpen, stream, message.SerializeAsString());
  return stream;
}

Status Session::offer(StreamId stream, BulkItem item) {
  if (dead_) return fail(*dead_);
  return sender_.offer(stream, std::move(item));
}

void Session::close_stream(StreamId stream, std::optional<Error> error) {
  if (!dead_) sender_.close(stream, std::move(error));
}

std::optional<StreamCounts> Session::counts(StreamId stream) const { return sender_.counts(stream); }

std::uint64_t Session::under_way_of(std::optional<StreamId> stream) const {
  const FrameHeader* const header = decoder_.header_under_way();
  if (!header || header->type != FrameType::kBulk || header->stream != stream.value_or(header->stream)) return 0;
  return decoder_.under_way() - std::min(decoder_.under_way(), kFrameHeaderBytes + kPieceHeaderBytes);
}

}  // namespace nodal
