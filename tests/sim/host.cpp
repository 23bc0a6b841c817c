#include "tests/sim/host.h"

namespace nodal::swarm {

Host::Host(std::unique_ptr<hal::sim::SimLink> link, Oracle& oracle, Documents& documents, Tally& tally,
           std::uint64_t seed)
    : link_(*link),
      line_(std::move(link), "a swarm's host"),
      oracle_(oracle),
      documents_(documents),
      tally_(tally),
      random_(seed, "host") {}

void Host::send(wire::Request request, Open open) {
  request.set_id(next_id_++);
  if (line_.session().send(request)) open_[request.id()] = open;
}

void Host::act() {
  if (dead() || open_.size() > 8) return;
  wire::Request request;
  switch (random_.below(8)) {
    case 0:
    case 1: request.mutable_status(); break;
    case 2: request.mutable_heads(); break;
    case 3: request.mutable_calibration_list(); break;
    case 4: request.mutable_genlock(); break;
    case 5: {
      request.mutable_pull()->set_coding(wire::PullRequest::RAW);
      request.mutable_pull()->set_count(1 + random_.below(6));
      request.mutable_pull()->set_lossless(random_.chance(300'000));
      break;
    }
    case 6: {
      if (sending_) return;
      const int which = static_cast<int>(random_.below(kCalibrations));
      const std::string& json = documents_.json[static_cast<std::size_t>(which)];
      request.mutable_upload_begin()->set_length(json.size());
      const auto bytes = std::span(reinterpret_cast<const std::uint8_t*>(json.data()), json.size());
      request.mutable_upload_begin()->set_sha256(sha256_to_wire(sha256(bytes)));
      return send(request, {which, std::nullopt});
    }
    case 7: request.mutable_head_set()->set_exposure_ns(1'000'000 * (1 + random_.below(20))); break;
  }
  send(request);
}

void Host::genlock(bool start) {
  wire::Request request;
  request.mutable_genlock()->set_action(start ? wire::GenlockRequest::START : wire::GenlockRequest::STOP);
  send(request);
}

void Host::handle(const wire::Reply& reply) {
  const auto found = open_.find(reply.id());
  if (found == open_.end()) return oracle_.fail("the rig answered a request that nobody made");
  const Open open = found->second;
  open_.erase(found);
  ++tally_.replies;
  oracle_.trace(reply.id() << 8 | static_cast<std::uint64_t>(reply.what_case()));
  if (open.upload_to_begin && reply.has_upload()) send_document(*open.upload_to_begin, reply.upload().offset());
  if (!open.upload_to_commit || !reply.has_done()) return;
  ++tally_.uploads;
  documents_.sure = *open.upload_to_commit;
  documents_.maybe = {};
}

void Host::send_document(int which, std::uint64_t offset) {
  const std::string& json = documents_.json[static_cast<std::size_t>(which)];
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(json.begin(), json.end());
  const auto item = UploadSender(bytes).item(offset);
  const auto stream = line_.session().open_stream(StreamPolicy::kLossless);
  if (!item || !stream) return;
  (void)line_.session().offer(*stream, *item);
  line_.session().close_stream(*stream);
  sending_ = Sending{which, *stream};
}

/// Control frames overtake bulk frames: the commit waits until the last byte has been sent.
void Host::commit_when_sent() {
  if (!sending_ || line_.session().counts(sending_->stream)) return;
  const std::string& json = documents_.json[static_cast<std::size_t>(sending_->which)];
  wire::Request request;
  request.mutable_upload_commit()->set_sha256(
      sha256_to_wire(sha256({reinterpret_cast<const std::uint8_t*>(json.data()), json.size()})));
  documents_.maybe[static_cast<std::size_t>(sending_->which)] = true;
  send(request, {std::nullopt, sending_->which});
  sending_.reset();
}

void Host::pump() {
  while (auto event = line_.take()) {
    if (const auto* reply = std::get_if<wire::Reply>(&*event)) {
      handle(*reply);
    } else if (const auto* piece = std::get_if<BulkPiece>(&*event)) {
      if (piece->first) {
        pixels_.clear();
        if (!raymap_.ParseFromString(piece->meta)) oracle_.fail("a raymap's header cannot be read");
      }
      pixels_.insert(pixels_.end(), piece->data.begin(), piece->data.end());
      const PixelFormat format = pixel_format_named(raymap_.coding()).value_or(PixelFormat::kGrey8);
      if (pixels_.size() ==
          packed_size(format, static_cast<int>(raymap_.width()), static_cast<int>(raymap_.height()))) {
        oracle_.on_raymap(raymap_, pixels_, documents_.id);
      }
    }
  }
  if (!dead()) commit_when_sent();
  line_.write();
}

void Host::split(std::uint32_t bytes) { link_.in().split = link_.out().split = bytes; }
void Host::stall(bool stalled) { link_.in().stalled = link_.out().stalled = stalled; }
void Host::flip_bit() { link_.out().flip_bit = random_.below(4096); }
void Host::replay() {
  // Repeats the last written bytes, regardless of frame boundaries.
  (void)link_.write(line_.recently_written());
}
void Host::leave_mid_upload() {
  const int which = static_cast<int>(random_.below(kCalibrations));
  if (!dead()) send_document(which, 0);
  sending_.reset();
  link_.out().split = 512;
  pump();
  line_.leave();
  link_.reset();
}

}  // namespace nodal::swarm
