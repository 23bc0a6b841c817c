#include "firmware/hosts/frame_sender.h"

#include <fmt/format.h>

#include <algorithm>

#include "firmware/frame/drain.h"
#include "protocol/base/try.h"
#include "protocol/upload.h"

namespace nodal::firmware {

const FrameSender::Copy* FrameSender::free_copy() const {
  const auto found = std::ranges::find_if(copies_, &Copy::free);
  return found == copies_.end() ? nullptr : &*found;
}

Result<StreamId> FrameSender::start(Client& client, const HeadShapes& heads, Duration period, Instant now) {
  const auto copy = std::ranges::find_if(copies_, &Copy::free);
  NODAL_ASSERT(copy != copies_.end());
  if (!copy->memory) copy->memory = std::make_shared<std::vector<std::uint8_t>>();
  SetCopy set = SetCopy::places_for(heads, copy->memory);
  if (set.wanted == 0)
    return fail(Errc::kNotReady, "no head has delivered a picture yet; `nodal status` shows the reason");
  NODAL_TRY_ASSIGN(auto stream, client.session().open_stream(StreamPolicy::kLossless));
  sets_.drop_waiting();  // older than the request
  sets_.set_open(true);
  copy->transfer = Transfer{client.number(), client.access(), stream, now, kPatience.at(period), std::move(set), false};
  client.frame_set = stream;
  return stream;
}

/// Null when the client has disconnected, has stopped the stream or has received all of it.
Client* FrameSender::receiver(const Clients& clients, const Transfer& transfer) const {
  const auto found = std::ranges::find_if(clients, [&](const auto& c) { return c->number() == transfer.client; });
  Client* const client = found == clients.end() || (*found)->ending() ? nullptr : found->get();
  return client && client->session().counts(transfer.stream) ? client : nullptr;
}

bool FrameSender::step(const Clients& clients, std::optional<Access> waiting, Instant now) {
  follow_adoptions();
  bool busy = take_set();
  for (Copy& copy : copies_) busy |= copy.transfer && step(copy, clients, now);
  busy |= end_longest(clients, waiting, now);
  const bool wanted = std::ranges::any_of(copies_, [](const Copy& c) { return c.transfer && !c.transfer->copied; });
  if (!wanted) {
    sets_.set_open(false);
    sets_.drop_waiting();
  }
  return busy;
}

/// Copies a set for every transfer that waits for one.
bool FrameSender::take_set() {
  const auto set = sets_.take();
  if (!set) return false;
  for (Copy& copy : copies_) {
    if (!copy.transfer || copy.transfer->copied) continue;
    copy.transfer->set.fill(**set);
    copy.transfer->copied = true;
  }
  return true;
}

bool FrameSender::step(Copy& copy, const Clients& clients, Instant now) {
  Transfer& transfer = *copy.transfer;
  Client* const client = receiver(clients, transfer);
  if (!client) {
    end(copy, clients);
    return true;
  }
  if (transfer.sent) {
    if (!transfer.sent->stalled(*client->session().counts(transfer.stream), now)) return false;
    client->end(StreamProgress::error("the frame set"), now);
    end(copy, clients);
    return true;
  }
  // The calibration in force for the set is known when the blend has begun this set or a later one.
  if (transfer.copied && blender_.sets_begun() > transfer.set.set) {
    follow_adoptions();
    transfer.sent.emplace(now);
    transfer.since = now;
    send(*client, transfer.set, transfer.stream);
    return true;
  }
  if (now - transfer.since <= transfer.patience) return false;
  client->session().close_stream(
      transfer.stream, Error{Errc::kOverload, fmt::format("no frame set could be copied within {} s: no frames arrive, "
                                                          "or the blend has a backlog; `nodal status` shows which",
                                                          transfer.patience.ms() / 1000)});
  end(copy, clients);
  return true;
}

/// Ends a transfer for a host that waits, unless a copy is free or a session is about to release one.
bool FrameSender::end_longest(const Clients& clients, std::optional<Access> waiting, Instant now) {
  if (!waiting || !std::ranges::all_of(copies_, [](const Copy& copy) { return copy.transfer.has_value(); }))
    return false;
  Copy* longest = nullptr;
  for (Copy& copy : copies_) {
    const Transfer& transfer = *copy.transfer;
    const Duration share = transfer.access > *waiting ? kShareBeforeView : kShare;
    if (!transfer.sent || now - transfer.since < share) continue;
    if (!longest || transfer.since < longest->transfer->since) longest = &copy;
  }
  if (!longest) return false;
  if (Client* const client = receiver(clients, *longest->transfer)) {
    client->end(Error{Errc::kTimeout,
                      "this host did not receive the frame set within its share of time, and other "
                      "hosts wait for one; try again"},
                now);
  }
  end(*longest, clients);
  return true;
}

void FrameSender::end(Copy& copy, const Clients& clients) {
  for (const auto& client : clients) {
    if (client->number() == copy.transfer->client) client->frame_set.reset();
  }
  copy.transfer.reset();
}

void FrameSender::follow_adoptions() {
  drain(blender_.swap().adoptions_out(), [&](const Adoption& adoption) {
    before_ = in_force_;
    in_force_ = adoption;
  });
}

void FrameSender::send(Client& client, const SetCopy& set, StreamId stream) {
  wire::FrameSetHeader header;
  header.set_set(set.set);
  header.set_mid_exposure_ns(static_cast<std::uint64_t>(set.mid_exposure.ns()));
  const auto& calibration = in_force_ && in_force_->first_set <= set.set ? in_force_ : before_;
  if (calibration) header.set_calibration_id(sha256_to_wire(calibration->calibration));
  header.set_spread_ns(static_cast<std::uint64_t>(set.sync.spread.ns()));
  header.set_genlock(std::string(genlock_state_name(set.sync.state)));
  for (std::size_t i = 0; i < config_.heads.size(); ++i) {
    if ((set.heads & head_bit(i)) == 0) continue;
    const SetCopy::Place& place = set.places[i];
    wire::HeadPicture& picture = *header.add_heads();
    picture.set_index(static_cast<std::uint32_t>(i));
    picture.set_name(config_.heads[i].name);
    picture.set_format(std::string(pixel_format_name(place.shape.format)));
    picture.set_width(static_cast<std::uint32_t>(place.shape.width));
    picture.set_height(static_cast<std::uint32_t>(place.shape.height));
    picture.set_offset(place.offset);
    if (place.shape.format == PixelFormat::kMjpeg) picture.set_jpeg_bytes(place.bytes);
    picture.set_video_range(place.coding.video_range);
    picture.set_bt709(place.coding.bt709);
    picture.set_exposure_ns(static_cast<std::uint64_t>(place.in_effect.exposure.duration().ns()));
    picture.set_gain_mdb(place.in_effect.gain.mdb());
  }
  (void)client.session().offer(stream, BulkItem{header.SerializeAsString(), set.bytes, 0});
  client.session().close_stream(stream);
}

}  // namespace nodal::firmware
