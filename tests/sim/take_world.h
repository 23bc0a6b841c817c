// Cards, the people who handle them, and two rigs that record on them.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "hal/sim/card_slot.h"
#include "hal/sim/clock.h"
#include "hal/sim/scene/random.h"
#include "tests/support/take_stage.h"

namespace nodal::swarm {

/// What happened, over all seeds.
struct TakeTally {
  std::uint64_t takes = 0;  ///< finished, also those that were recovered
  std::uint64_t recovered = 0;
  std::uint64_t refused = 0;  ///< starts
  std::uint64_t kills = 0;
  std::uint64_t power_cuts = 0;
  std::uint64_t exchanges = 0;
  std::uint64_t pulls = 0;
  std::uint64_t brought = 0;  ///< takes that were brought by hand
  std::uint64_t removed = 0;  ///< takes that were removed by hand or on request
  std::uint64_t ejects = 0;
  std::uint64_t hang_ups = 0;    ///< how often a nodald ended by itself, as at SIGHUP
  std::uint64_t vanished = 0;    ///< hosts that asked and were gone
  std::uint64_t rates = 0;       ///< changes of the rate
  std::uint64_t clock_sets = 0;  ///< changes of boards' clocks
  std::uint64_t floods = 0;
  void add(const TakeTally& other);
};

/// Two nodalds share one slot, in which three cards are exchanged. Everything is drawn from the seed: who records and
/// stops, who is killed, when the power fails, when a card is exchanged, pulled or put back, which takes people copy
/// there and take away, when a terminal hangs up on nodald, which hosts ask and are gone, which flood it, and how
/// boards' clocks are set. Sets come at 1/1000 to 240 Hz, at another rate than rig.toml's, and rates change.
///
/// After each event the truth is compared with the cards: a folder that once had a manifest never changes, but by a
/// request to delete it; a number is never used for a second take of a card; what was durable is in the take after its
/// recovery; a take says the rate at which each of its sets came; a take is finished when nodald ends by itself; at
/// most one nodald records on a card. At the end the cards are put in one after the other, and every take on them must
/// be finished.
///
/// Threading: thread-bound.
/// Errors: run() returns what is wrong, in one sentence.
class TakeWorld {
 public:
  explicit TakeWorld(std::uint64_t seed);

  std::optional<std::string> run(int events);
  const TakeTally& tally() const { return tally_; }

 private:
  using Bytes = std::vector<std::uint8_t>;
  using Files = std::map<std::string, Bytes>;
  /// At which sets come, each from a number of the rig's on.
  using Rates = std::map<std::uint64_t, FrameRate>;
  /// One card, and what must be on it.
  struct Card {
    std::shared_ptr<hal::sim::SimDisk> disk;
    std::map<std::string, Files> kept;             ///< files of takes with a manifest, by folder
    std::map<std::string, std::uint64_t> durable;  ///< number of durable sets of takes without a manifest
    std::set<std::string> used;                    ///< folders that a take ever had
    std::map<std::string, Rates> rates;            ///< rates of takes without a manifest
  };
  struct Daemon {
    std::unique_ptr<hal::DiskPort> port;
    std::unique_ptr<firmware::TakeStage> stage;  ///< null: it is dead
    Card* card = nullptr;                        ///< the card that its take is on; null: it records none
    std::uint64_t take = 0;
  };

  void begin(Daemon& daemon);
  void end(Daemon& daemon, bool cut);
  void act();
  void act_on(Daemon& daemon);
  void handle_cards();
  void lose_contact();
  void act_as_host(Daemon& daemon);
  void start(Daemon& daemon, bool waits = true);
  void hang_up(Daemon& daemon);
  void vanish(Daemon& daemon);
  void flood(Daemon& daemon);
  void change_rate(Daemon& daemon);
  void set_clock(Daemon& daemon);
  FrameRate some_rate();
  void bring_take();
  void remove_take();
  void cut_power();
  void run_for(Duration length);
  void note_durable(const Daemon& daemon);
  void follow(Daemon& daemon);
  void check();
  void check(Card& card);
  void check_finished(Card& card, const std::string& folder, const Files& files);
  void check_rates(const Rates& rates, const std::string& folder, const Files& files);
  void check_all_finished();
  static Files files_of(hal::sim::SimDisk& disk, const std::string& folder);
  Card* card_in_slot();
  void fail(std::string why);

  hal::sim::Random random_;
  const FrameRate rate_;  ///< most sets come at this one
  hal::sim::SimClock clock_;
  hal::sim::SimCardSlot slot_;
  std::array<Card, 3> cards_;
  std::array<Daemon, 2> daemons_;
  std::optional<std::string> failure_;
  std::string event_;  ///< the newest
  TakeTally tally_;
};

}  // namespace nodal::swarm
