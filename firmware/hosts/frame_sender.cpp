#include "firmware/hosts/frame_sender.h"

#include <algorithm>

#include "protocol/upload.h"

namespace nodal::firmware {

Result<StreamId> FrameSender::start(Client& client, const HeadShapes& heads, Instant now) {
  const bool others_turn = waiting_ != 0 && waiting_ != client.number() && now < waiting_until_;
  if (transfer_ || others_turn) {
    if (!others_turn && transfer_->client != client.number()) {
      waiting_ = client.number();
      waiting_until_ = now + kTurn;
    }
    return fail(Errc::kBusy, "the rig is still sending a frame set to this or another host; try again later");
  }
  waiting_ = 0;
  if (!memory_) memory_ = std::make_shared<std::vector<std::uint8_t>>();
  SetCopy copy = SetCopy::places_for(heads, memory_);
  if (copy.wanted == 0)
    return fail(Errc::kNotReady, "no head has delivered a picture yet; `nodal status` shows the reason");
  auto stream = client.session().open_stream(StreamPolicy::kLossless);
  if (!stream) return stream;
  sets_.drop_waiting();
  sets_.set_open(true);
  transfer_ = Transfer{client.number(), *stream, now, std::move(copy), false, false};
  client.frame_set = *stream;
  return stream;
}

/// Null when the client has disconnected, has stopped the stream or has received all of it.
Client* FrameSender::receiver(const Clients& clients) const {
  const auto found = std::find_if(clients.begin(), clients.end(),
                                  [&](const auto& client) { return client->number() == transfer_->client; });
  Client* const client = found == clients.end() || (*found)->finished() ? nullptr : found->get();
  return client && client->session().counts(transfer_->stream) ? client : nullptr;
}

bool FrameSender::step(const Clients& clients, Instant now) {
  follow_adoptions();
  if (!transfer_) return false;
  Client* const client = receiver(clients);
  if (transfer_->sent) {
    const bool going_out = client || memory_.use_count() > 2;  // held here and by the copy
    if (going_out && (client ? keeps_pace(*client, now) : now - transfer_->since <= kGrace)) return false;
    if (client) {
      client->session().close_stream(
          transfer_->stream,
          Error{Errc::kTimeout, "this host receives the frame set too slowly: at this rate it " +
                                    std::string("needs more than ") + std::to_string(kSlowest.ms() / 1000) + " s"});
    }
    if (going_out) memory_.reset();  // that host's session still refers to it and frees it
    end(clients);
    return true;
  }
  if (!client) {
    end(clients);
    return true;
  }
  if (!transfer_->copied) {
    if (const auto set = sets_.take()) {
      transfer_->copy.fill(**set);
      transfer_->copied = true;
      sets_.set_open(false);
    }
  }
  // The calibration in force for the set is known when the blend has begun this set or a later one.
  if (transfer_->copied && blender_.sets_begun() > transfer_->copy.set) {
    follow_adoptions();
    transfer_->sent = true;
    transfer_->since = now;
    send(*client);
    return true;
  }
  if (now - transfer_->since <= kPatience) return false;
  client->session().close_stream(
      transfer_->stream,
      Error{Errc::kOverload, "no frame set could be copied within " + std::to_string(kPatience.ms() / 1000) +
                                 " s: no frames arrive, or the blend has a backlog; `nodal status` shows which"});
  end(clients);
  return true;
}

void FrameSender::end(const Clients& clients) {
  for (const auto& client : clients) {
    if (client->number() == transfer_->client) client->frame_set.reset();
  }
  transfer_.reset();
  sets_.set_open(false);
  sets_.drop_waiting();
}

bool FrameSender::keeps_pace(const Client& client, Instant now) const {
  const Duration taken = now - transfer_->since;
  if (taken <= kGrace) return true;
  const auto counts = client.session().counts(transfer_->stream);
  if (!counts || taken > kSlowest || now - client.written() > kGrace) return false;
  const auto due =
      memory_->size() * static_cast<std::uint64_t>((taken - kGrace).ms()) / static_cast<std::uint64_t>(kSlowest.ms());
  return counts->bytes >= due;
}

void FrameSender::follow_adoptions() {
  while (auto adoption = blender_.adoptions_out().pop()) {
    before_ = in_force_;
    in_force_ = adoption;
  }
}

void FrameSender::send(Client& client) {
  const SetCopy& set = transfer_->copy;
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
  (void)client.session().offer(transfer_->stream, BulkItem{header.SerializeAsString(), set.bytes, 0});
  client.session().close_stream(transfer_->stream);
}

}  // namespace nodal::firmware
