supple_together(
  "deform/bulge_volume_test.cpp deform/deformed_field_test.cpp pairs/approach_test.cpp pairs/sleep_test.cpp"
  "pairs/find_contacts_test.cpp response/motion_test.cpp response/stick_test.cpp surface/closed_forms_test.cpp
   surface/mild_kinks_test.cpp surface/star_test.cpp"
  "response/react_test.cpp surface/panels_test.cpp"
  "surface/contact_surface_test.cpp surface/contact_rules_test.cpp"
  "surface/imprint_test.cpp surface/invariance_test.cpp")
