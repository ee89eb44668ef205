// Sizes of structs of the C interface, as NAME=BYTES in a line, for the C# tests.
#include <limber/limber.h>
#include <stdio.h>

#define TELL(type) printf("%s=%zu ", #type, sizeof(type))

int main(void) {
  TELL(limber_placement);
  TELL(limber_world_options);
  TELL(limber_joint_options);
  TELL(limber_hit);
  TELL(limber_hit_event);
  TELL(limber_model_data);
  TELL(limber_asset_joint);
  TELL(limber_machine_placement);
  TELL(limber_stage_times);
  printf("\n");
  return 0;
}
