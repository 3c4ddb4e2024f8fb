/// Raised once, from any thread, and seen at once by all who poll its descriptor.
#pragma once

#include "server/files.h"

namespace radbake::server {

class StopSignal {
 public:
  /// Throws std::system_error where no descriptor is to be had.
  StopSignal();
  void Raise();
  bool raised() const;
  int descriptor() const { return event_.get(); }  ///< readable when raised

 private:
  Descriptor event_;
};

}  // namespace radbake::server
