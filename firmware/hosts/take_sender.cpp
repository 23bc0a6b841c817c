#include "firmware/hosts/take_sender.h"

#include <algorithm>
#include <utility>

#include "firmware/hosts/admission.h"
#include "firmware/hosts/shared_bytes.h"

namespace nodal::firmware {

// A host whose transfer was ended may hold one piece until its connection is closed.
static_assert(TakesInUse::kMaxReaders >= Admission::in_all(Admission::kMaxClients));
static_assert(TakeReader::kBuffers >= TakeSender::kAhead + Admission::in_all(Admission::kMaxClients));

Result<StreamId> TakeSender::start(Client& client, const wire::TakeRead& request, Instant now) {
  if (!reader_) {
    return fail(Errc::kUnsupported, "this rig records nothing; give it a section [takes] in its rig.toml");
  }
  if (transfer_) {
    return fail(Errc::kBusy, "the rig is sending a file of a take to this or another host; try again later");
  }
  if (request.offset() % TakeReader::kPiece != 0) {
    return fail(Errc::kBadValue, "a file of a take can be read from multiples of 1 MiB on");
  }
  auto stream = client.session().open_stream(StreamPolicy::kLossless);
  if (!stream) return stream;
  Transfer& begun = transfer_.emplace();
  begun.number = ++transfers_;
  begun.client = client.number();
  begun.stream = *stream;
  begun.take = request.take();
  begun.file = request.file();
  begun.next = request.offset();
  begun.moved = now;
  client.take_file = *stream;
  note_reading(client.number(), request.take(), now);
  return stream;
}

/// A host reads one take at a time.
void TakeSender::note_reading(std::uint64_t client, std::uint64_t take, Instant now) {
  auto place = std::ranges::find(readings_, client, &Reading::client);
  if (place == readings_.end()) place = std::ranges::find(readings_, 0U, &Reading::client);
  if (place == readings_.end()) return;  // of hosts that left a moment ago
  *place = {client, take, now};
  reader_->in_use().set(static_cast<std::size_t>(place - readings_.begin()), take);
}

bool TakeSender::forget_readers(const Clients& clients, Instant now) {
  bool busy = false;
  for (std::size_t k = 0; k < readings_.size(); ++k) {
    Reading& reading = readings_[k];
    if (reading.client == 0) continue;
    const bool here = std::ranges::any_of(
        clients, [&](const auto& client) { return client->number() == reading.client && !client->ending(); });
    if (here && now - reading.newest < kReadFor) continue;
    reading = {};
    reader_->in_use().set(k, 0);
    busy = true;
  }
  return busy;
}

Status TakeSender::check_unread(const Clients& clients, const Client& client, std::uint64_t take) const {
  for (const Reading& reading : readings_) {
    if (reading.client == 0 || reading.client == client.number() || reading.take != take) continue;
    const auto who = std::ranges::find(clients, reading.client, [](const auto& each) { return each->number(); });
    if (who == clients.end() || (*who)->ending()) continue;
    return fail(Errc::kBusy, "take " + std::to_string(take) + " is being copied by " + (*who)->name() +
                                 "; delete it when the copy is done, or close that host: nodal hosts --end " +
                                 std::to_string(reading.client));
  }
  return {};
}

/// Null when the client has disconnected, has stopped the stream or has received all of it.
Client* TakeSender::receiver(const Clients& clients) const {
  const auto found = std::find_if(clients.begin(), clients.end(),
                                  [&](const auto& client) { return client->number() == transfer_->client; });
  Client* const client = found == clients.end() || (*found)->ending() ? nullptr : found->get();
  return client && client->session().counts(transfer_->stream) ? client : nullptr;
}

bool TakeSender::step(const Clients& clients, Instant now) {
  if (!reader_) return false;
  Client* client = transfer_ ? receiver(clients) : nullptr;
  bool busy = forget_readers(clients, now);
  busy |= take_answers(client);
  if (!transfer_) return busy;
  client = receiver(clients);  // an answer may have ended the stream
  if (!client) {
    for (const auto& each : clients) {
      if (each->number() == transfer_->client) each->take_file.reset();
    }
    transfer_.reset();
    return true;
  }
  busy |= order(*client);
  const auto counts = client->session().counts(transfer_->stream);
  const bool waits_for_host = counts && counts->pending > 0;
  // The stream's own bytes: a host may read everything else, and give no credit for this stream.
  const std::uint64_t sent = counts ? counts->bytes : 0;
  if (!waits_for_host || sent > transfer_->sent_bytes) transfer_->moved = now;
  note_reading(client->number(), transfer_->take, transfer_->moved);
  transfer_->sent_bytes = sent;
  if (waits_for_host && now - transfer_->moved > kGrace) {
    end(*client, {Errc::kTimeout, "this host has read nothing for " + std::to_string(kGrace.ms() / 1000) +
                                      " s; another host may want a take"});
    return true;
  }
  return busy;
}

bool TakeSender::take_answers(Client* client) {
  bool busy = false;
  while (auto answer = reader_->answers().pop()) {
    busy = true;
    --ordered_;
    const bool wanted = client && transfer_ && answer->transfer == transfer_->number && !transfer_->all_ordered;
    if (!wanted) continue;  // of an ended transfer, or ordered behind the end of the file
    if (!answer->piece) {
      end(*client, answer->piece.error());
      client = nullptr;
      continue;
    }
    const std::uint64_t file_bytes = answer->piece->file_bytes;
    const std::uint64_t after = answer->offset + answer->piece->bytes->size();
    if (!answer->piece->bytes->empty()) {
      wire::TakePiece meta;
      meta.set_offset(answer->offset);
      meta.set_file_bytes(file_bytes);
      // It has room: at most kAhead items are pending.
      (void)client->session().offer(transfer_->stream,
                                    BulkItem{meta.SerializeAsString(), shared_bytes(answer->piece->bytes), 0});
    }
    if (after < file_bytes) continue;
    transfer_->all_ordered = true;
    client->session().close_stream(transfer_->stream);
  }
  return busy;
}

bool TakeSender::order(const Client& client) {
  bool busy = false;
  const auto pending = client.session().counts(transfer_->stream)->pending;
  while (!transfer_->all_ordered && ordered_ + pending < kAhead) {
    const bool ordered = reader_->orders().push({transfer_->number, transfer_->take, transfer_->file, transfer_->next});
    NODAL_ASSERT(ordered);  // it has room for kAhead
    ++ordered_;
    transfer_->next += TakeReader::kPiece;
    busy = true;
  }
  return busy;
}

void TakeSender::end(Client& client, const Error& why) {
  client.session().close_stream(transfer_->stream, why);
  client.take_file.reset();
  transfer_.reset();
}

}  // namespace nodal::firmware
