// Sends files of finished takes to a host.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

#include "firmware/hosts/client.h"
#include "firmware/hosts/fair_queue.h"
#include "firmware/hosts/stream_progress.h"
#include "firmware/record/take_reader.h"
#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// Sends one file to each host that asks. Hosts share the disk in turns of one piece (FairQueue), so a host gets its
/// share however many others read, and however slowly they do. Each piece is one item of a lossless stream. The takes'
/// reader reads the pieces. A host has at most kAhead pieces in memory, and one while others read too. A host that
/// reads slowly keeps its stream, because nobody waits for its memory; the stream of one that reads nothing ends
/// (StreamProgress).
///
/// It notes which takes hosts read, so that nobody deletes them meanwhile. A host copies a take file by file, so it
/// reads the take until it has neither begun a file of it nor received kReadPace more of one for kReadFor, or until it
/// disconnects. So a host that reads a byte a minute does not keep a take on a disk that needs room.
///
/// Threading: thread-bound to control.
/// Ownership: the reader outlives it; sessions hold the pieces that they send.
/// Errors: start() returns kUnsupported, kBadValue; the reader's errors and kTimeout end the stream.
class TakeSender {
 public:
  /// `reader`: null in a rig that records nothing.
  explicit TakeSender(TakeReader* reader) : reader_(reader) {}

  /// Opens the stream of a file. The host must not receive one already.
  Result<StreamId> start(Client& client, const wire::TakeRead& request, Instant now);
  /// True when it did something.
  bool step(const Clients& clients, Instant now);
  /// Errors: kBusy, naming the host, if another one than `client` reads the take.
  Status check_unread(const Clients& clients, const Client& client, std::uint64_t take) const;

  /// Pieces of a host that are ordered or not sent completely.
  static constexpr std::size_t kAhead = TakeReader::kOrders;
  /// A host may check what it has before it asks for more.
  static constexpr Duration kReadFor = Duration::seconds(60);
  static constexpr std::uint64_t kReadPace = TakeReader::kPiece;  ///< bytes; 17 kB/s

 private:
  struct Reading {
    std::uint64_t client = 0;  ///< 0: none
    std::uint64_t take = 0;
    Instant newest;  ///< when the host last made progress with it
  };
  void note_reading(std::uint64_t client, std::uint64_t take, Instant now);
  bool forget_readers(const Clients& clients, Instant now);
  struct Transfer {
    std::uint64_t number = 0;
    StreamId stream = 0;
    std::uint64_t take = 0;
    std::string file;
    std::uint64_t next = 0;    ///< offset of the next piece to order
    std::size_t ordered = 0;   ///< unanswered orders
    bool all_ordered = false;  ///< the end of the file has been read
    std::uint64_t noted = 0;   ///< bytes that the link had taken at the last call of note_reading()
    StreamProgress progress;
  };
  using Transfers = std::map<std::uint64_t, Transfer>;

  bool take_answers(const Clients& clients);
  void send(Client& client, Transfer& transfer, const ReadAnswer& answer);
  bool step(Client& client, Transfer& transfer, Instant now);
  bool order_pieces();

  TakeReader* const reader_;
  std::array<Reading, TakesInUse::kMaxReaders> readings_;
  Transfers transfers_;  ///< by host
  FairQueue turns_;      ///< hosts that may order another piece
  std::uint64_t begun_ = 0;
  std::size_t ordered_ = 0;  ///< unanswered orders, those of ended transfers included
};

}  // namespace nodal::firmware
