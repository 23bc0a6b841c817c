#include "host_tool/web/download.h"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "host_tool/offload/take_fetch.h"
#include "protocol/base/try.h"
#include "protocol/take/digest.h"

namespace nodal::host::web {

struct Downloads::Shared {
  RigDesk::Connect connect;
  std::function<void()> wake;
  std::mutex mutex;  ///< protects all below
  std::condition_variable thread_ended;
  std::size_t open = 0;     ///< downloads, of which some have a thread
  std::size_t threads = 0;  ///< which may be more for a moment: a rig that is waited for is not interrupted
};

class Downloads::Download final : public look::Pieces {
 public:
  Download(std::shared_ptr<Shared> shared, std::uint64_t take, std::string file, const ByteRange& range)
      : shared_(std::move(shared)), queue_(std::make_shared<Queue>()) {
    queue_->take = take;
    queue_->file = std::move(file);
    queue_->range = range;
  }
  ~Download() override {
    {
      const std::lock_guard lock(queue_->mutex);
      queue_->stops = true;
      queue_->room.notify_all();
    }
    const std::lock_guard lock(shared_->mutex);
    --shared_->open;
  }

  std::uint64_t size() const override { return queue_->range.length; }

  std::optional<std::size_t> read(char* into, std::size_t room) override {
    if (!started_) begin();
    const std::lock_guard lock(queue_->mutex);
    if (queue_->pieces.empty()) return queue_->failed ? std::nullopt : std::optional<std::size_t>(0);
    std::vector<std::uint8_t>& first = queue_->pieces.front();
    const std::size_t count = std::min(room, first.size() - given_);
    std::memcpy(into, first.data() + given_, count);
    given_ += count;
    if (given_ == first.size()) {
      queue_->pieces.pop_front();
      given_ = 0;
      queue_->room.notify_one();
    }
    return count;
  }

 private:
  struct Queue {
    std::uint64_t take = 0;
    std::string file;
    ByteRange range;
    std::mutex mutex;  ///< protects all below
    std::condition_variable room;
    std::deque<std::vector<std::uint8_t>> pieces;
    bool stops = false, failed = false;
  };

  void begin() {
    started_ = true;
    const std::lock_guard lock(shared_->mutex);
    ++shared_->threads;
    std::thread([shared = shared_, queue = queue_] {
      const Status done = fetch(*shared, *queue);
      {
        const std::lock_guard end(queue->mutex);
        queue->failed = !done;
      }
      shared->wake();
      const std::lock_guard end(shared->mutex);
      --shared->threads;
      shared->thread_ended.notify_all();
    }).detach();
  }

  /// From the rig, which reads from multiples of kPiece on, into the queue.
  static Status fetch(Shared& shared, Queue& queue) {
    NODAL_TRY_ASSIGN(const std::unique_ptr<RigConnection> rig, shared.connect());
    constexpr std::uint64_t kPiece = take::PieceHashes::kPiece;
    const std::uint64_t end = queue.range.begin + queue.range.length;
    bool complete = false;
    const Status fetched =
        fetch_file(*rig, queue.take, queue.file, queue.range.begin / kPiece * kPiece,
                   [&](std::uint64_t offset, std::span<const std::uint8_t> bytes) -> Status {
                     const std::uint64_t from = std::max(offset, queue.range.begin);
                     const std::uint64_t to = std::min(offset + bytes.size(), end);
                     if (from < to) {
                       const auto part =
                           bytes.subspan(static_cast<std::size_t>(from - offset), static_cast<std::size_t>(to - from));
                       std::unique_lock lock(queue.mutex);
                       queue.room.wait(lock, [&] { return queue.stops || queue.pieces.size() < kMaxWaiting; });
                       if (queue.stops) return fail(Errc::kCancelled, "the browser went away");
                       queue.pieces.emplace_back(part.begin(), part.end());
                     }
                     shared.wake();
                     complete = to == end;
                     return complete ? fail(Errc::kCancelled, "the range is complete") : Status();
                   });
    return complete  ? Status()
           : fetched ? fail(Errc::kTruncated, "the file is shorter than its manifest says")
                     : fetched;
  }

  const std::shared_ptr<Shared> shared_;
  const std::shared_ptr<Queue> queue_;
  std::size_t given_ = 0;  ///< bytes of the first piece that were read
  bool started_ = false;
};

Downloads::Downloads(RigDesk::Connect connect, std::function<void()> wake) : shared_(std::make_shared<Shared>()) {
  shared_->connect = std::move(connect);
  shared_->wake = std::move(wake);
}

Downloads::~Downloads() {
  std::unique_lock lock(shared_->mutex);
  shared_->thread_ended.wait(lock, [&] { return shared_->threads == 0; });
}

Result<std::shared_ptr<look::Pieces>> Downloads::start(std::uint64_t take, const std::string& file,
                                                       const ByteRange& range) {
  const std::lock_guard lock(shared_->mutex);
  if (std::max(shared_->open, shared_->threads) >= kMaxDownloads) {
    return fail(Errc::kOverload,
                fmt::format("{} files are being downloaded already; wait for one of them", kMaxDownloads));
  }
  ++shared_->open;
  return std::make_shared<Download>(shared_, take, file, range);
}

}  // namespace nodal::host::web
