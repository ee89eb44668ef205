# Seconds of the entries that take longest, on two cores. CTest starts these first, lest it end with one of them and an idle core.
set_tests_properties(tools.surfaces_made_elsewhere PROPERTIES COST 60)
set_tests_properties(view.page_of_asset_in_a_browser PROPERTIES COST 30)
set_tests_properties(view.page_of_scene_in_a_browser PROPERTIES COST 47)
set_tests_properties(tools.stability_within_its_limits PROPERTIES COST 28)
set_tests_properties(view.page_of_machine_in_a_browser PROPERTIES COST 21)
set_tests_properties(examples.13_a_robot_boxes PROPERTIES COST 8)
# Sanitized, where an entry is a program:
set_tests_properties(engine PROPERTIES COST 190)
set_tests_properties(collision PROPERTIES COST 122)
set_tests_properties(articulation PROPERTIES COST 95)
