// The stage that reads finished takes from the disk for hosts.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware/record/recorder.h"
#include "firmware/record/takes_in_use.h"
#include "hal/disk.h"
#include "protocol/base/loan.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

/// One piece of a file of a take.
struct ReadOrder {
  std::uint64_t transfer = 0;  ///< returned in the answer
  std::uint64_t take = 0;
  std::string file;          ///< its name, as a host sent it
  std::uint64_t offset = 0;  ///< byte in the file
};

struct PieceOfTake {
  std::uint64_t file_bytes = 0;  ///< length of the whole file
  /// TakeReader::kPiece bytes, or those up to the end of the file.
  Loan<std::vector<std::uint8_t>> bytes;
};

struct ReadAnswer {
  std::uint64_t transfer = 0;
  std::uint64_t offset = 0;
  Result<PieceOfTake> piece;
};

/// Reads pieces of files, one in each step. Recording has priority: nothing is read while the recorder's memory is
/// filled above kReadsUpTo, because the disk then is busy with writing.
///
/// Threading: step() is thread-bound to a thread of its own, which blocks on the disk. orders() and answers() are SPSC
///   rings with control.
/// Ownership: disk, recorder and `in_use` outlive it, and it outlives the pieces. No file stays open between steps.
///   Pieces are read into memory that is used again.
/// Errors: in the answers: kBadValue for a name that no file of a take has, kNotFound, kWrongState for a take without a
///   manifest, those of the disk.
class TakeReader {
 public:
  TakeReader(hal::DiskPort& disk, Recorder& recorder, TakesInUse& in_use)
      : disk_(disk), recorder_(recorder), in_use_(in_use), orders_(kOrders), answers_(kOrders) {}

  /// True when it did something.
  bool step();

  SpscRing<ReadOrder>& orders() { return orders_; }
  SpscRing<ReadAnswer>& answers() { return answers_; }
  /// Control notes there which takes are being read.
  TakesInUse& in_use() { return in_use_; }

  static constexpr std::size_t kPiece = std::size_t{1} << 20;
  /// Orders that are not answered yet; control sends no more.
  static constexpr std::size_t kOrders = 4;
  /// Pieces in memory. While all are held, nothing is read.
  static constexpr std::size_t kBuffers = 46;
  /// Takes are read while at most this percentage of the recorder's memory is used.
  static constexpr std::size_t kReadsUpTo = 25;

 private:
  Result<PieceOfTake> read(const ReadOrder& order, Loan<std::vector<std::uint8_t>> into);
  Result<PieceOfTake> read_there(const ReadOrder& order, Loan<std::vector<std::uint8_t>> into);

  hal::DiskPort& disk_;
  Recorder& recorder_;
  TakesInUse& in_use_;
  LoanPool<std::vector<std::uint8_t>> buffers_{kBuffers};
  SpscRing<ReadOrder> orders_;
  SpscRing<ReadAnswer> answers_;
};

}  // namespace nodal::firmware
