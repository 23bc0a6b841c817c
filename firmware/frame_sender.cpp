#include "firmware/frame_sender.h"

#include <algorithm>

#include "protocol/upload.h"

namespace nodal::firmware {

Result<StreamId> FrameSender::start(Client& client, const HeadShapes& heads, Instant now) {
  if (asked_) return fail(Errc::kBusy, "a frame set is on its way to another host, or to this one; ask again after it");
  TappedSet places;
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < heads.size(); ++i) {
    if (!heads[i] || heads[i]->format == PixelFormat::kMjpeg) continue;
    places.places[i] = {heads[i]->format, heads[i]->width, heads[i]->height, bytes, {}};
    places.wanted |= head_bit(i);
    bytes += packed_size(heads[i]->format, heads[i]->width, heads[i]->height);
  }
  if (places.wanted == 0) return fail(Errc::kNotReady, "no head has delivered a picture yet; status says why");
  auto stream = client.session().open_stream(StreamPolicy::kLossless);
  if (!stream) return stream;
  if (!memory_) memory_ = std::make_shared<std::vector<std::uint8_t>>();
  memory_->resize(bytes);
  places.bytes = memory_;
  NODAL_ASSERT(tap_.want(std::move(places)));
  asked_ = Asked{client.number(), *stream, now, false};
  return stream;
}

bool FrameSender::step(const Clients& clients, Instant now) {
  if (!asked_) return false;
  const auto found = std::find_if(clients.begin(), clients.end(),
                                  [&](const auto& client) { return client->number() == asked_->client; });
  // A stream that the host has stopped counts nothing any more, as one that has gone out whole.
  Client* client = found == clients.end() || (*found)->finished() ? nullptr : found->get();
  if (client && !client->session().counts(asked_->stream)) client = nullptr;
  if (asked_->filled) {
    const bool going_out = client || memory_.use_count() > 1;
    if (going_out && now - asked_->since <= kSlowest) return false;
    if (client) {
      client->session().close_stream(asked_->stream, Error{Errc::kTimeout, "this host did not take the frame set within " +
                                                           std::to_string(kSlowest.ms() / 1000) + " s"});
    }
    if (going_out) memory_.reset();  // it goes with that host's session
    asked_.reset();
    return true;
  }
  if (auto set = tap_.take()) {
    asked_->filled = true;
    asked_->since = now;
    if (client) send(*client, std::move(*set));
    return true;
  }
  if (client && now - asked_->since <= kPatience) return false;
  if (!tap_.withdraw()) return false;  // it is being filled just now
  if (client) {
    client->session().close_stream(
        asked_->stream, Error{Errc::kOverload, "no frame set could be copied within " + std::to_string(kPatience.ms() / 1000) +
                                                   " s: no frames come, or the blend is behind; status says which"});
  }
  asked_.reset();
  return true;
}

void FrameSender::send(Client& client, TappedSet set) {
  wire::FrameSetHeader header;
  header.set_set(set.set);
  header.set_mid_exposure_ns(static_cast<std::uint64_t>(set.mid_exposure.ns()));
  if (set.blended) header.set_calibration_id(sha256_to_wire(set.calibration));
  header.set_spread_ns(static_cast<std::uint64_t>(set.sync.spread.ns()));
  header.set_genlock(std::string(genlock_state_name(set.sync.state)));
  for (std::size_t i = 0; i < config_.heads.size(); ++i) {
    if ((set.heads & head_bit(i)) == 0) continue;
    const TappedSet::Place& place = set.places[i];
    wire::HeadPicture& picture = *header.add_heads();
    picture.set_index(static_cast<std::uint32_t>(i));
    picture.set_name(config_.heads[i].name);
    picture.set_format(std::string(pixel_format_name(place.format)));
    picture.set_width(static_cast<std::uint32_t>(place.width));
    picture.set_height(static_cast<std::uint32_t>(place.height));
    picture.set_offset(place.offset);
    picture.set_exposure_ns(static_cast<std::uint64_t>(place.in_effect.exposure.duration().ns()));
    picture.set_gain_mdb(place.in_effect.gain.mdb());
  }
  (void)client.session().offer(asked_->stream, BulkItem{header.SerializeAsString(), std::move(set.bytes), 0});
  client.session().close_stream(asked_->stream);
}

}  // namespace nodal::firmware
