# The stages beside the models: compensation, profiles, colour spaces, prediction.
if(TARGET veneer::render AND TARGET veneer::tracking)
  veneer_add_test(stability_stages SRCS stages_colour_pose_test.cc stages_compensation_test.cc
    DEPS veneer::base veneer::tracking veneer::calibration veneer::render)
endif()
# Every program of the suite, for ./dev stability.
add_custom_target(veneer_stability_tests)
foreach(part models stages)
  if(TARGET veneer_stability_${part}_test)
    add_dependencies(veneer_stability_tests veneer_stability_${part}_test)
  endif()
endforeach()
