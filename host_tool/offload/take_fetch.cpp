#include "host_tool/offload/take_fetch.h"

#include <fmt/format.h>

#include <algorithm>

#include "host_tool/console/interrupt.h"
#include "host_tool/rig/bulk_item.h"
#include "host_tool/rig/rig_input.h"
#include "host_tool/rig/stream_wait.h"
#include "protocol/base/try.h"
#include "protocol/take/digest.h"

namespace nodal::host {
namespace {

using take::PieceHashes;

constexpr Duration kAskAgainAfter = Duration::milliseconds(250);
constexpr std::int64_t kPatiences = 12;  // a rig that records sends only while its disk has time

Error cancelled() { return {Errc::kCancelled, "interrupted"}; }

/// Opens the stream. Older rigs refuse while another host receives a take.
Result<StreamId> begin(RigConnection& rig, std::uint64_t take, const std::string& file, std::uint64_t offset) {
  wire::Request request;
  request.mutable_take_read()->set_take(take);
  request.mutable_take_read()->set_file(file);
  request.mutable_take_read()->set_offset(offset);
  for (Duration waited;; waited = waited + kAskAgainAfter) {
    if (interrupted()) return fail(cancelled());
    const Result<wire::Reply> started = rig.ask(request);
    if (started) return started->pull().stream();
    if (started.error().code != Errc::kBusy || waited >= rig.patience()) return fail(started.error());
    NODAL_TRY(rig.rest(kAskAgainAfter));
  }
}

Status out_of_order(const std::string& file) {
  return fail(Errc::kProtocol, fmt::format("the rig sent the pieces of {} in another order than they have", file));
}

}  // namespace

Status fetch_file(RigConnection& rig, std::uint64_t take, const std::string& file, std::uint64_t offset,
                  const OnPiece& on_piece) {
  NODAL_TRY_ASSIGN(const StreamId stream, begin(rig, take, file, offset));
  BulkItemBytes bytes;
  StreamWait wait(rig, stream, rig.patience() * kPatiences, file);
  while (true) {
    const Result<Event> event = wait.next();
    if (interrupted()) {
      rig.stop_stream(stream);
      return fail(cancelled());
    }
    if (!event) return fail(event.error());
    if (const auto* piece = std::get_if<BulkPiece>(&*event)) {
      if (piece->first) {
        NODAL_TRY_ASSIGN(const wire::TakePiece meta,
                         parse_clean<wire::TakePiece>(piece->meta, "header of a take's piece"));
        if (meta.offset() != offset) return out_of_order(file);
        NODAL_TRY(bytes.begin(*piece, PieceHashes::kPiece, "a piece of a take"));
      }
      bytes.add(*piece);
      if (!piece->last) continue;
      const std::span<const std::uint8_t> whole = bytes.bytes();
      if (whole.empty()) return fail(Errc::kProtocol, fmt::format("the rig sent a piece of {} without bytes", file));
      if (const Status taken = on_piece(offset, whole); !taken) {
        rig.stop_stream(stream);
        return taken;
      }
      offset += whole.size();
    } else if (const auto* closed = std::get_if<StreamClosed>(&*event)) {
      if (closed->error) return fail(*closed->error);
      return {};
    }
  }
}

Result<std::vector<std::uint8_t>> fetch_small_file(RigConnection& rig, std::uint64_t take, const std::string& file,
                                                   std::size_t limit) {
  std::vector<std::uint8_t> all;
  NODAL_TRY(fetch_file(rig, take, file, 0, [&](std::uint64_t, std::span<const std::uint8_t> bytes) -> Status {
    if (all.size() + bytes.size() > limit) {
      return fail(Errc::kTooLarge, fmt::format("{} of take {} has more than {} bytes", file, take, limit));
    }
    all.insert(all.end(), bytes.begin(), bytes.end());
    return {};
  }));
  return all;
}

}  // namespace nodal::host
