#include "firmware/hosts/take_sender.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "firmware/frame/drain.h"
#include "firmware/hosts/admission.h"
#include "firmware/hosts/shared_bytes.h"
#include "firmware/operate/commands.h"
#include "protocol/base/try.h"

namespace nodal::firmware {

static_assert(TakesInUse::kMaxReaders >= Admission::in_all(Admission::kMaxClients));
// Hosts that may read takes.
constexpr std::size_t kReaders = Admission::places(Admission::kMaxClients, Access::kControl) +
                                 Admission::places(Admission::kMaxClients, Access::kOperate);
// Of each of them the piece that it receives, and one of an ended transfer that its session sends to its end; what is
// ordered; and what the only reader had before others came.
static_assert(TakeReader::kBuffers >= 2 * kReaders + 2 * TakeSender::kAhead);

namespace {

/// Null when it has disconnected.
Client* find(const Clients& clients, std::uint64_t host) {
  const auto found = std::ranges::find_if(clients, [&](const auto& client) { return client->number() == host; });
  return found == clients.end() || (*found)->ending() ? nullptr : found->get();
}

}  // namespace

Result<StreamId> TakeSender::start(Client& client, const wire::TakeRead& request, Instant now) {
  if (!reader_) {
    return fail(no_takes());
  }
  if (request.offset() % TakeReader::kPiece != 0) {
    return fail(Errc::kBadValue, "a file of a take can be read from multiples of 1 MiB on");
  }
  NODAL_TRY_ASSIGN(auto stream, client.session().open_stream(StreamPolicy::kLossless));
  transfers_.insert_or_assign(client.number(), Transfer{.number = ++begun_,
                                                        .stream = stream,
                                                        .take = request.take(),
                                                        .file = request.file(),
                                                        .next = request.offset(),
                                                        .progress = StreamProgress(now)});
  client.take_file = stream;
  note_reading(client.number(), request.take(), now);
  return stream;
}

/// A host reads one take at a time.
void TakeSender::note_reading(std::uint64_t client, std::uint64_t take, Instant now) {
  auto place = std::ranges::find(readings_, client, &Reading::client);
  if (place == readings_.end()) place = std::ranges::find(readings_, 0U, &Reading::client);
  if (place == readings_.end()) return;  // all places are taken by hosts that left a moment ago
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
    return fail(
        Errc::kBusy,
        fmt::format(
            "take {} is being copied by {}; delete it when the copy is done, or close that host: nodal hosts --end {}",
            take, (*who)->name(), reading.client));
  }
  return {};
}

bool TakeSender::step(const Clients& clients, Instant now) {
  if (!reader_) return false;
  bool busy = forget_readers(clients, now);
  busy |= take_answers(clients);
  for (auto each = transfers_.begin(); each != transfers_.end();) {
    Client* const client = find(clients, each->first);
    const bool open = client && client->session().counts(each->second.stream);
    if (open && step(*client, each->second, now)) {
      ++each;
      continue;
    }
    if (client) client->take_file.reset();
    turns_.leave(each->first);
    each = transfers_.erase(each);
    busy = true;
  }
  return order_pieces() || busy;
}

/// False when the transfer has ended.
bool TakeSender::step(Client& client, Transfer& transfer, Instant now) {
  const auto counts = client.session().counts(transfer.stream);
  const std::size_t pending = counts->pending;
  if (counts->bytes - transfer.noted >= kReadPace) {
    transfer.noted = counts->bytes;
    note_reading(client.number(), transfer.take, now);
  }
  if (transfer.progress.stalled(*counts, now)) {
    client.session().close_stream(transfer.stream, StreamProgress::error("the file"));
    return false;
  }
  const std::size_t most = transfers_.size() == 1 ? kAhead : 1;
  const bool ready = !transfer.all_ordered && pending + transfer.ordered < most;
  if (!ready) turns_.leave(client.number());
  else if (!turns_.waits(client.number())) turns_.add({client.number(), client.access(), client.identity()});
  return true;
}

bool TakeSender::take_answers(const Clients& clients) {
  return drain(reader_->answers(), [&](const ReadAnswer& answer) {
    --ordered_;
    const auto found =
        std::ranges::find_if(transfers_, [&](const auto& each) { return each.second.number == answer.transfer; });
    if (found == transfers_.end()) return;  // it has ended
    --found->second.ordered;
    Client* const client = find(clients, found->first);
    if (client && !found->second.all_ordered) send(*client, found->second, answer);
  });
}

void TakeSender::send(Client& client, Transfer& transfer, const ReadAnswer& answer) {
  if (!answer.piece) {
    transfer.all_ordered = true;
    client.session().close_stream(transfer.stream, answer.piece.error());
    return;
  }
  const std::uint64_t file_bytes = answer.piece->file_bytes;
  const std::uint64_t after = answer.offset + answer.piece->bytes->size();
  if (!answer.piece->bytes->empty()) {
    wire::TakePiece meta;
    meta.set_offset(answer.offset);
    meta.set_file_bytes(file_bytes);
    // It has room: at most kAhead items are pending.
    (void)client.session().offer(transfer.stream,
                                 BulkItem{meta.SerializeAsString(), shared_bytes(answer.piece->bytes), 0});
  }
  if (after < file_bytes) return;
  transfer.all_ordered = true;
  client.session().close_stream(transfer.stream);
}

/// One piece for each turn.
bool TakeSender::order_pieces() {
  bool busy = false;
  while (ordered_ < TakeReader::kOrders) {
    const auto host = turns_.next();
    if (!host) break;
    Transfer& transfer = transfers_.at(*host);
    const bool ordered = reader_->orders().push({transfer.number, transfer.take, transfer.file, transfer.next});
    NODAL_ASSERT(ordered);  // it has room for kOrders
    ++ordered_;
    ++transfer.ordered;
    transfer.next += TakeReader::kPiece;
    busy = true;
  }
  return busy;
}

}  // namespace nodal::firmware
